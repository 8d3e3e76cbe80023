"""Laws of the solve: what a float64 model of painted surfaces was changed by is found again, and no more than that."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from kit.painted_world import CHANGES, DABS, ELSEWHERE, LEVELS, METAL, PLASTIC, Look, World, painted
from reference import solve as ref

from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence
from usdslf.inference.fit import (
    Problem,
    Rows,
    Specular,
    Way,
    fit,
    fit_robustly,
    fit_rows,
    fit_rows_robustly,
    relative_residuals,
)
from usdslf.inference.solve import enumerate_candidates, refit, refit_problem, relative_error
from usdslf.inference.weights import Options
from usdslf.inference.whitening import whiten
from usdslf.surfaces.surface_points import SurfacePoints


@pytest.fixture(scope="module")
def world() -> World:
    return World()


@pytest.fixture(scope="module")
def levels(world: World) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Columns on all levels, (n, 20, 4, 3) and (B, 20, 4, 3), by model."""
    return {
        model: (
            np.stack([world.columns(model, r) for r in LEVELS], 1),
            np.stack([world.background(model, r) for r in LEVELS], 1),
        )
        for model in ("preview_surface", "phong")
    }


def solved(
    e: Evidence, options: Options | None = None, model: str = "preview_surface"
) -> tuple[Tables, Candidate, list]:
    tables = pool_tables([e], 0, model)
    candidates = enumerate_candidates(tables, options)
    return tables, refit(refit_problem(tables, options), candidates[0]), candidates


def look_of(tables: Tables, c: Candidate) -> tuple[np.ndarray, np.ndarray, float]:
    roughness = c.roughness_of(np.array([tables.roughness]))
    return c.diffuse_of(tables.diffuse), c.f0_of(tables.f0), float(roughness[0])


@pytest.mark.parametrize("name", CHANGES)
def test_what_was_changed_is_found_again(world: World, levels: dict, name: str) -> None:
    before, after = CHANGES[name]
    tables, found, candidates = solved(painted(world, levels, before, after))
    assert found.id == name.split()[-1], [(c.id, round(c.cost, 1)) for c in candidates]
    diffuse, f0, roughness = look_of(tables, found)
    np.testing.assert_allclose(diffuse, after.diffuse, atol=5e-3)
    np.testing.assert_allclose(f0, after.f0, atol=5e-3)
    assert roughness == pytest.approx(after.roughness, abs=1e-6)  # it lies on a level
    assert relative_error(tables, found) < 1e-3


def test_two_changes_at_once_are_found_where_both_are_free(world: World, levels: dict) -> None:
    after = replace(PLASTIC, diffuse=(0.15, 0.5, 0.3), f0=(0.3, 0.3, 0.3))
    tables, _, candidates = solved(painted(world, levels, PLASTIC, after))
    both = next(c for c in candidates if c.id == "diffuse+specular")
    diffuse, f0, _ = look_of(tables, refit(refit_problem(tables), both))
    np.testing.assert_allclose(diffuse, after.diffuse, atol=0.01)
    np.testing.assert_allclose(f0, after.f0, atol=0.01)
    assert relative_error(tables, refit(refit_problem(tables), both)) < 0.01
    assert "diffuse" in candidates[0].freed


def test_alternatives_are_all_there_once_and_cheapest_first(world: World, levels: dict) -> None:
    _, _, candidates = solved(painted(world, levels, *CHANGES["diffuse"]))
    ids, cost = [c.id for c in candidates], {c.id: c.cost for c in candidates}
    assert ids[0] == "diffuse" and len(set(ids)) == len(ids) == 8
    without = [cost[i] for i in ids if "diffuse" not in i]
    assert min(without) > 10 + max(cost[i] for i in ids if "diffuse" in i), cost
    assert cost["diffuse"] < cost["diffuse+specular"] < cost["diffuse+specular+glossiness"]  # freedom costs
    assert {"none", "diffuse", "specular", "glossiness", "diffuse+specular+glossiness"} <= set(ids)
    for c in candidates:
        value = np.array([0.3, 0.2, 0.1])
        if "diffuse" not in c.freed:
            np.testing.assert_array_equal(c.diffuse_of(value), value)
        if "specular" not in c.freed:
            np.testing.assert_array_equal(c.f0_of(value), value)
        if "glossiness" not in c.freed:
            np.testing.assert_array_equal(c.roughness_of(value), value)


def test_l0_frees_one_and_l2_frees_all(world: World, levels: dict) -> None:
    after = Look((0.15, 0.5, 0.3), (0.3, 0.3, 0.3), 0.5)
    for change in (after, CHANGES["glossiness"][1], CHANGES["diffuse"][1]):
        e = painted(world, levels, PLASTIC, change)
        assert len(solved(e, Options(norm="l0"))[1].freed) <= 1
        tables, found, _ = solved(e, Options(norm="l2"))
        assert found.freed == ("diffuse", "specular", "glossiness")
        diffuse, f0, roughness = look_of(tables, found)  # all free, and still the truth
        np.testing.assert_allclose(diffuse, change.diffuse, atol=0.03)
        np.testing.assert_allclose(f0, change.f0, atol=0.03)
        assert roughness == pytest.approx(change.roughness, abs=0.051)


@pytest.mark.parametrize("factor", [0.0, 0.05, 30.0])
@pytest.mark.parametrize("before", [PLASTIC, METAL])
def test_reflectance_stays_possible_whatever_is_painted(
    world: World, levels: dict, before: Look, factor: float
) -> None:
    """Black, and brighter than any surface could be."""
    e = painted(world, levels, before, before)
    tables, found, candidates = solved(replace(e, target=e.target * factor * np.array([1, 1.5, 0.2])))
    for c in [found, *candidates]:
        # Held to the bounds before the residual is taken, not afterwards.
        for value in (tables.diffuse + c.delta_diffuse, tables.f0 + c.delta_f0):
            assert (value > -1e-6).all() and (value < 1 + 1e-6).all(), c
        diffuse, f0, roughness = look_of(tables, c)
        assert (diffuse >= 0).all() and (diffuse <= 1).all() and (f0 >= 0).all() and (f0 <= 1).all(), c
        assert 0.001 <= roughness <= 1 and np.isfinite(c.cost) and np.isfinite(c.misfit), c
    assert relative_error(tables, found) <= relative_error(tables, Candidate((), level=tables.own)) + 1e-9


def rearranged(e: Evidence, order: np.ndarray) -> Evidence:
    """The same evidence with its dabs in another order."""
    samples = np.concatenate([order, np.arange(DABS, DABS + ELSEWHERE)])
    place = np.argsort(order)
    surface = SurfacePoints(**{f.name: getattr(e.surface, f.name)[samples] for f in fields(SurfacePoints)})
    return replace(
        e, target=e.target[order], surface=surface, levels=e.levels[samples], columns=e.columns[samples],
        unchanging=e.unchanging[samples], background_sample=place[e.background_sample],
    )  # fmt: skip


def same(a: Candidate, b: Candidate, rtol: float = 1e-6) -> None:
    assert a.id == b.id
    np.testing.assert_allclose(a.delta_diffuse, b.delta_diffuse, rtol=rtol, atol=1e-7)
    np.testing.assert_allclose(a.delta_f0, b.delta_f0, rtol=rtol, atol=1e-7)
    assert a.roughness_shift == pytest.approx(b.roughness_shift, abs=1e-9)


@pytest.mark.parametrize("name", ["diffuse", "sharper glossiness"])
def test_the_answer_knows_no_order_no_unit_and_no_favourite_channel(world: World, levels: dict, name: str) -> None:
    e = painted(world, levels, *CHANGES[name])
    noise = np.exp(np.random.default_rng(1).normal(size=e.target.shape) * 0.03)
    e = replace(e, target=e.target * noise)
    _, found, candidates = solved(e)

    _, again, others = solved(rearranged(e, np.random.default_rng(2).permutation(DABS)))
    same(again, found)
    assert [c.id for c in others][:2] == [c.id for c in candidates][:2]
    np.testing.assert_allclose([c.cost for c in others], [c.cost for c in candidates], rtol=0.05)

    gain = 1e3  # radiance in other units
    brighter = replace(e, target=gain * e.target, columns=gain * e.columns, background=gain * e.background)
    same(solved(brighter)[1], found, rtol=1e-4)

    swap = [2, 0, 1]
    look = {k: getattr(e.surface, k)[:, swap] for k in ("diffuse", "f0", "f90")}
    turned = replace(
        e, target=e.target[:, swap], columns=e.columns[..., swap], background=e.background[..., swap],
        surface=replace(e.surface, **look),
    )  # fmt: skip
    got = solved(turned)[1]
    same(
        replace(got, delta_diffuse=got.delta_diffuse[np.argsort(swap)], delta_f0=got.delta_f0[np.argsort(swap)]), found
    )


@pytest.mark.parametrize("name", ["diffuse", "specular", "coloured specular", "glossiness"])
def test_painting_the_old_look_on_the_new_surface_takes_the_change_back(world: World, levels: dict, name: str) -> None:
    before, after = CHANGES[name]
    tables, found, _ = solved(painted(world, levels, after, before))
    assert found.id == name.split()[-1]
    diffuse, f0, roughness = look_of(tables, found)
    np.testing.assert_allclose(diffuse, before.diffuse, atol=5e-3)
    np.testing.assert_allclose(f0, before.f0, atol=5e-3)
    assert roughness == pytest.approx(before.roughness, abs=1e-6)


def test_light_that_no_parameter_changes_is_taken_off_first(world: World, levels: dict) -> None:
    e = painted(world, levels, *CHANGES["diffuse"])
    glow = 0.3 * e.target.mean()
    n = DABS
    shining = replace(e, unchanging=np.full_like(e.unchanging, glow), target=e.target + glow)
    tables, found, _ = solved(shining)
    assert found.id == "diffuse" and n == len(tables.target)
    np.testing.assert_allclose(look_of(tables, found)[0], CHANGES["diffuse"][1].diffuse, atol=5e-3)


def test_two_strokes_on_one_material_are_one_question(world: World, levels: dict) -> None:
    """Two halves of a stroke, asked together, say what the whole says about the value."""
    e = painted(world, levels, *CHANGES["specular"])
    halves = []
    for half in (np.arange(0, DABS, 2), np.arange(1, DABS, 2)):
        rest = np.setdiff1d(np.arange(DABS), half)
        moved = rearranged(e, np.concatenate([half, rest]))
        keep = moved.background_sample < len(half)
        dab = moved.dab_of_sample.copy()
        painted_here = {"target": moved.target[: len(half)], "material": moved.material[: len(half)]}
        unpainted = {
            "background_sample": moved.background_sample[keep],
            "background": moved.background[keep],
        }
        halves.append(replace(moved, dab_of_sample=dab, **painted_here, **unpainted))
    # What was painted by the other half is unpainted in this one.
    tables = pool_tables(halves, 0)
    assert len(tables.target) == DABS and len(np.unique(tables.stroke)) == 2
    found = refit(refit_problem(tables), enumerate_candidates(tables)[0])
    assert found.id == "specular"
    np.testing.assert_allclose(look_of(tables, found)[1], CHANGES["specular"][1].f0, atol=5e-3)


@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_phong_without_noise_is_the_papers_closed_form(world: World, levels: dict, roughness: float) -> None:
    """Two parameters, one channel at a time: Eqs. 3, 5 and 6, with any weights."""
    before = Look((0.4, 0.3, 0.2), (0.1, 0.1, 0.1), roughness)
    column = world.columns("phong", roughness)[:DABS]
    weight = np.random.default_rng(0).uniform(0.5, 2, DABS)
    for change in (
        {"diffuse": (0.2, 0.5, 0.1), "f0": (0.3, 0.05, 0.4)},
        {"diffuse": (0.2, 0.5, 0.1)},
        {"f0": (0.3, 0.05, 0.4)},
    ):
        after = replace(before, **change)
        e = painted(world, levels, before, after, "phong")
        expected = []
        for c in range(3):
            m, d = ref.normal_equations(column[:, [0, 2], c], e.target[:, c], weight)
            if len(change) == 2:
                expected.append(ref.both(m, d))
            elif "diffuse" in change:
                expected.append([ref.diffuse_only(m, d, before.f0[c]), before.f0[c]])
            else:
                expected.append([before.diffuse[c], ref.specular_only(m, d, before.diffuse[c])])
        name = "+".join({"diffuse": "diffuse", "f0": "specular"}[k] for k in change)
        tables, _, candidates = solved(e, model="phong")
        chosen = refit(refit_problem(tables), next(c for c in candidates if c.id == name))
        diffuse, f0, _ = look_of(tables, chosen)
        np.testing.assert_allclose(np.stack([diffuse, f0], 1), expected, atol=2e-4)


def test_levels_that_are_fitted_together_are_fitted_each_for_itself(world: World, levels: dict) -> None:
    look = replace(PLASTIC, diffuse=(0.6, 0.1, 0.1), f0=(0.3, 0.1, 0.05))
    tables, *_ = solved(painted(world, levels, PLASTIC, look))
    tables = replace(tables, target=tables.target * np.random.default_rng(3).uniform(0.6, 1.4, tables.target.shape))
    problem, every = Problem.of(tables, Options()), range(tables.own + 1)
    for way in (Way(True), Way(False, Specular.GREY), Way(True, Specular.COLOR), Way(True, is_factor=True)):
        for how in (fit, fit_robustly):
            together = how(problem, way, every)
            for level in every:
                alone = how(problem, way, (level,))
                np.testing.assert_allclose(together.dd[level], alone.dd[0], rtol=1e-3, atol=1e-4)
                np.testing.assert_allclose(together.df[level], alone.df[0], rtol=1e-3, atol=1e-4)
                np.testing.assert_allclose(together.misfit[level], alone.misfit[0], rtol=1e-4)
        c = way.candidate(together.dd[2], together.df[2], 2)
        r = problem.white @ relative_residuals(tables, c).reshape(-1)
        np.testing.assert_allclose(problem.misfit(r), together.misfit[2], rtol=1e-9)


@pytest.mark.parametrize("model", ["preview_surface", "phong"])
def test_ways_that_are_fitted_side_by_side_are_fitted_each_for_itself(world: World, levels: dict, model: str) -> None:
    look = replace(PLASTIC, diffuse=(0.95, 0.1, 0.1), f0=(0.3, 0.1, 0.05))
    tables, *_ = solved(painted(world, levels, PLASTIC, look, model=model), model=model)
    tables = replace(tables, target=tables.target * np.random.default_rng(3).uniform(0.6, 1.4, tables.target.shape))
    problem = Problem.of(tables, Options())
    ways = [Way(d, s, g, f) for d in (True, False) for s in Specular for g in (True, False) for f in (True, False)]
    at = [(k * 5) % (tables.own + 1) for k in range(len(ways))]
    for beside, by_itself in ((fit_rows, fit), (fit_rows_robustly, fit_robustly)):
        together = beside(problem, Rows(tuple(ways), np.array(at)))
        alone = [by_itself(problem, way, (level,)) for way, level in zip(ways, at, strict=True)]
        for name in ("dd", "df", "misfit"):
            expected = np.concatenate([getattr(x, name) for x in alone])
            np.testing.assert_allclose(getattr(together, name), expected, rtol=1e-6, atol=1e-9)
    changes = {(w.diffuse, w.specular): (dd, df) for w, dd, df in zip(ways, together.dd, together.df, strict=True)}
    assert np.ptp(changes[False, Specular.GREY][1]) == 0 < np.ptp(changes[False, Specular.COLOR][1])
    for (diffuse, specular), (dd, df) in changes.items():
        assert dd.any() == diffuse and df.any() == (specular is not Specular.KEPT)


@pytest.mark.parametrize("change", [{"diffuse": (0.95, 0.9, 0.9)}, {"f0": (0.9, 0.9, 0.9)}, {"roughness": 0.5}])
def test_phong_gains_no_energy_and_its_misfit_is_of_what_it_may_reflect(
    world: World, levels: dict, change: dict
) -> None:
    """What is painted reflects up to 1.9 times what arrives."""
    before = Look((0.5, 0.45, 0.4), (0.3, 0.3, 0.3), 0.3)
    wanted = replace(before, **{"diffuse": (0.9, 0.8, 0.7), "f0": (0.9, 0.8, 0.9), **change})
    tables, _, candidates = solved(painted(world, levels, before, wanted, "phong"), model="phong")
    white, outlier = whiten(tables, Options()), Options().outlier
    for c in enumerate_candidates(tables):
        for found in (c, refit(refit_problem(tables), c)):
            most = found.diffuse_of(tables.diffuse) + found.f0_of(tables.f0)
            assert most.max() <= 1 + 1e-9, found.id
        r = white @ ((c.radiance(tables) - tables.target) / tables.scale).reshape(-1)
        of_dab = (r * r).reshape(-1, 3).sum(1)
        assert c.misfit == pytest.approx((outlier * np.log1p(of_dab / outlier)).sum(), rel=1e-6)
    free = replace(tables, must_hold_energy=False)
    both = refit(refit_problem(free), next(c for c in enumerate_candidates(free) if c.id == "diffuse+specular"))
    assert (both.diffuse_of(tables.diffuse) + both.f0_of(tables.f0)).max() > 1.2
    held = refit(refit_problem(tables), next(c for c in candidates if c.id == "diffuse+specular"))
    assert relative_error(tables, held) > 1.2 * relative_error(free, both)


def test_the_papers_factors_decide_how_many_parameters_change(world: World, levels: dict) -> None:
    """1, 1e9, 1e9: one as with l0; three alike: all of them; Options.of takes factors or costs by name."""
    look = replace(PLASTIC, diffuse=(0.6, 0.1, 0.1), roughness=0.5)
    e = painted(world, levels, PLASTIC, look)
    number = {
        factors: len(solved(e, Options.of(factors))[1].freed)
        for factors in ((1.0, 1e9, 1e9), (1.0, 5.0, 25.0), (1.0, 1e-9, 1e-18))
    }
    assert list(number.values()) == [1, 2, 3]
    dear, cheap = Options.of({"group": 1e6}), Options.of({"group": 0.0, "freedom": 0.0})
    assert len(solved(e, dear)[1].freed) == 1 and len(solved(e, cheap)[1].freed) >= 2
    assert Options().in_words() == "" and Options.of({"group": 8}).in_words() == "group 8"
    assert Options.of((1, 5, 25)).in_words() == "factors 1, 5, 25"
