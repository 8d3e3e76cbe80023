"""Two rows of squares that share a textured material."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from kit.look_stages import TYPES, F, add_material, add_quads, bind, new_stage
from pxr import Gf, Usd, UsdGeom, UsdShade, Vt

from usdslf.textures.images import write_image


def quads(stage: Usd.Stage, name: str, material: UsdShade.Material, left: float = 0.0) -> None:
    """Four squares side by side, whose st fill half of the image."""
    mesh = add_quads(stage, f"/World/{name}")
    points = np.array(mesh.GetPointsAttr().Get())
    st = points[:, :2] * [0.125, 1] + [left, 0]
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", F.TexCoord2fArray, "vertex")
    primvar.Set(Vt.Vec2fArray.FromNumpy(st.astype(np.float32)))
    bind(mesh.GetPrim(), material)


def textured_shot(folder: Path, inputs: dict[str, str], **constants: Any) -> Usd.Stage:
    """Two rows of squares that share a material, on halves of one image."""
    stage = new_stage(folder / "shot.usda")
    material = add_material(stage, "/World/mtl/tex", **constants)
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/tex/pbr"))
    if inputs:
        pixels = np.random.default_rng(5).uniform(0.2, 0.6, (40, 64, 3))
        write_image(folder / "map.exr", pixels)
        node = UsdShade.Shader.Define(stage, "/World/mtl/tex/map")
        node.CreateIdAttr("UsdUVTexture")
        node.CreateInput("file", F.Asset).Set("./map.exr")
        node.CreateInput("wrapS", F.Token).Set("repeat")
        node.CreateInput("scale", F.Float4).Set(Gf.Vec4f(0.5, 1, 1, 1))
        node.CreateInput("sourceColorSpace", F.Token).Set("raw")
        for name, channel in inputs.items():
            output = node.CreateOutput(channel, F.Float3 if channel == "rgb" else F.Float)
            shader.CreateInput(name, TYPES[name]).ConnectToSource(output)
    for name, left in (("row", 0.0), ("other", 0.5)):
        quads(stage, name, material, left)
    stage.GetRootLayer().Save()
    return stage
