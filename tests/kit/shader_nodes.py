"""Networks of shaders, of UsdPreviewSurface and of other renderers, on a quad."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface
from usdslf.usd.layer.wins import compose_over
from usdslf.usd.preview.preview_material import make_preview
from usdslf.usd.read.read import read_scene

N = Sdf.ValueTypeNames
KINDS = {1: N.Float, 2: N.Float2, 3: N.Color3f, 4: N.Float4}
CONTEXT = {"PxrSurface": "ri", "PxrDisney": "ri", "PxrDisneyBsdf": "ri", "standard_surface": "arnold"}


def kind_of(value: Any) -> Sdf.ValueTypeName:
    if isinstance(value, Sdf.AssetPath):
        return N.Asset
    if isinstance(value, str):
        return N.String
    if isinstance(value, bool | int):
        return N.Int
    return KINDS[len(np.ravel(value))]


class Nodes:
    """A stage with one quad of 2 x 2, and a network of shaders on it."""

    def __init__(self, path: Path) -> None:
        self.stage = Usd.Stage.CreateNew(str(path))
        self.stage.SetMetadata("metersPerUnit", 1.0)
        self.stage.SetMetadata("upAxis", "Y")
        world = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(world.GetPrim())
        self.mesh = UsdGeom.Mesh.Define(self.stage, "/World/quad")
        self.mesh.CreatePointsAttr([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        self.mesh.CreateExtentAttr([(-1, -1, 0), (1, 1, 0)])
        self.mesh.CreateFaceVertexCountsAttr([4])
        self.mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        self.mesh.CreateSubdivisionSchemeAttr("none")
        for name in ("st", "st1"):
            st = UsdGeom.PrimvarsAPI(self.mesh).CreatePrimvar(name, N.TexCoord2fArray, "vertex")
            size = 1.0 if name == "st" else 0.5
            st.Set(Vt.Vec2fArray([(0, 0), (size, 0), (size, size), (0, size)]))
        self.material = UsdShade.Material.Define(self.stage, "/World/mtl/a")
        UsdShade.MaterialBindingAPI.Apply(self.mesh.GetPrim()).Bind(self.material)

    def node(self, name: str, kind: str, output: str = "out", size: int = 3, **inputs: Any) -> UsdShade.Output:
        """A shader whose inputs are values, or the outputs of others; returns its output."""
        shader = UsdShade.Shader.Define(self.stage, f"/World/mtl/a/{name}")
        shader.CreateIdAttr(kind)
        for port, value in inputs.items():
            if isinstance(value, UsdShade.Output):
                shader.CreateInput(port, value.GetTypeName()).ConnectToSource(value)
            else:
                given = Gf.Vec3f(*value) if np.ndim(value) and len(value) == 3 else value
                shader.CreateInput(port, kind_of(value)).Set(given)
        return shader.CreateOutput(output, KINDS[size] if size else N.Token)

    def surface(self, kind: str, **inputs: Any) -> Nodes:
        context = "" if kind == "UsdPreviewSurface" else CONTEXT.get(kind, "mtlx")
        out = self.node("surface", kind, "surface" if not context else "out", 0, **inputs)
        self.material.CreateSurfaceOutput(context).ConnectToSource(out)
        self.stage.GetRootLayer().Save()
        return self

    def points(self, stage: Usd.Stage | None = None) -> SurfacePoints:
        rng = np.random.default_rng(3)
        uv = rng.uniform(0.05, 0.45, (40, 2))
        scene = read_scene(stage or self.stage, refine=0)
        assert not scene.materials[0].why_not_editable
        return evaluate_surface(scene, np.arange(40) % 2, uv)

    def made(self) -> tuple[SurfacePoints, list[str]]:
        made = make_preview(self.stage, None)
        review = compose_over(self.stage, made.layer)
        said = [w for w in made.warnings if not w.startswith("final renders of")]
        return self.points(review), said
