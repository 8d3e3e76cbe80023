"""What a stylized look holds where texture coordinates cannot carry it, and how near it comes, read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, ball, rectangle
from pxr import Usd, UsdGeom

from usdslf.elements.elements import refresh_reflectance
from usdslf.light_field.surface import Surface
from usdslf.session import Session
from usdslf.stylize.element_solve import follows_f0
from usdslf.stylize.unsharp_mask import take_misfit
from usdslf.surfaces.surface_points import evaluate_surface


@pytest.fixture(scope="module")
def styled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, Path]:
    """A ball without texture coordinates on a floor of four points without them, stylized and written."""
    b = StageBuilder(tmp_path_factory.mktemp("bare"))
    red = b.material("red", diffuseColor=(0.5, 0.1, 0.05), roughness=0.4)
    grey = b.material("grey", diffuseColor=(0.4, 0.4, 0.4), roughness=0.7)
    b.mesh("floor", rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)), grey)
    b.mesh("ball", ball(0.6), red)
    b.rect_light("lamp", (1, 3, 1.5), (0, 0, 0), 0.8, 0.8, (12, 12, 11))
    b.camera((0, 1.5, 4), (0, 0.5, 0))
    path = b.save()
    stage = Usd.Stage.Open(str(path))
    for prim in stage.TraverseAll():
        if prim.IsA(UsdGeom.Mesh):
            prim.RemoveProperty("primvars:st")
            prim.RemoveProperty("primvars:st:indices")
    stage.Save()
    session = Session(str(path), elements=700, bounces=3)
    session.stylize()
    session.author(path.parent / "look.usda")
    return session, path.parent / "look.usda"


def _of(session: Session, name: str) -> np.ndarray:
    on = np.array([m.path.endswith(name) for m in session.scene.meshes])[session.elements.mesh]
    return np.flatnonzero(on)


def test_points_carry_what_coordinates_cannot(styled: tuple[Session, Path]) -> None:
    session, look = styled
    rows, e = _of(session, "ball"), session.elements
    written = session.edited(look).scene
    there = evaluate_surface(written, e.triangle[rows], e.barycentric[rows])
    was = evaluate_surface(session.scene, e.triangle[rows], e.barycentric[rows])
    wanted = session.stylized.change_at(rows)[0].mean(1)
    found = (there.diffuse - was.diffuse).mean(1)
    assert np.ptp(found) > 0.05
    assert np.corrcoef(wanted, found)[0, 1] > 0.85
    assert np.square(found - wanted).mean() < 0.5 * wanted.var()
    report = {m["material"].rpartition("/")[2]: m for m in session.report()["materials"]}
    assert "primvar" in report["red"]["representation"]


def test_what_no_carrier_brings_nearer_stays(styled: tuple[Session, Path]) -> None:
    """The floor's change as a mean would darken all of it for the contact shadow's sake."""
    session, look = styled
    assert any("/grey: diffuse changes by its mean" in w and "points are too far apart" in w for w in session.warnings)
    assert any("/grey stays as it is" in w for w in session.warnings)
    assert not [e for e in session.edits if "/grey/" in e.prim]
    rows, e = _of(session, "floor"), session.elements
    there = evaluate_surface(session.edited(look).scene, e.triangle[rows], e.barycentric[rows])
    np.testing.assert_allclose(there.diffuse, 0.4, atol=1e-6)


def test_residuals_as_written_are_those_of_the_look_read_back(styled: tuple[Session, Path]) -> None:
    """The light field of the composed shot, built by another session, against the light that was wanted."""
    session, look = styled
    other = session.edited(look)
    elements = refresh_reflectance(session.elements, session.scene, other.scene)
    light = other.light_field
    np.testing.assert_array_equal(light.surface.diffuse, Surface.of(elements).diffuse)
    misfit = take_misfit(light, session.stylized.wanted_d)
    outgoing = light.device.download(light.outgoing_d).astype(np.float64)
    wanted = light.device.download(session.stylized.wanted_d).astype(np.float64)
    np.testing.assert_allclose(misfit[:, 0], ((outgoing - wanted) ** 2).sum((1, 2)), rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(misfit[:, 1], (wanted**2).sum((1, 2)), rtol=1e-3)
    for style in session.stylized.styles:
        off, all_ = misfit[style.elements].sum(0)
        assert style.residual_as_written == pytest.approx(np.sqrt(off / all_), rel=0.02)
    grey, red = session.stylized.styles
    assert not grey.freed
    assert red.residual_after < red.residual_as_written
    assert red.residual_as_written < 0.5 * (red.residual_before + red.residual_after)


def test_metals_are_told_from_dielectrics(styled: tuple[Session, Path]) -> None:
    field = styled[0].light_field
    assert not follows_f0(field).any()
    s = field.surface
    try:
        field.set_surface(replace(s, diffuse=0 * s.diffuse, f90=s.f0))
        assert follows_f0(field).all()
    finally:
        field.set_surface(s)
