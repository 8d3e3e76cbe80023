"""Siblings of the inputs that failed: other types, counts and places of the values that drive a colour.

A card of two faces in a dome of radiance 1 is painted (.1, .4, .05), which means a diffuse colour of PAINTED.  The shot
with its look shows that, whatever drove the colour before.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import usdslf
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.textures.images import write_image
from usdslf.usd.author.read_back import scene_under

PAINTED = (0.066, 0.379, 0.014)
STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
    %(above)s
    def Camera "cam"
    {
        float focalLength = 50
        float horizontalAperture = 40
        float verticalAperture = 22.5
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "dome"
    {
        float inputs:intensity = 1
    }
    def Mesh "card" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)]
        uniform token subdivisionScheme = "none"
        rel material:binding = </World/m>
        %(card)s
    }
    def Material "m"
    {
        token outputs:surface.connect = </World/m/s.outputs:surface>
        def Shader "s"
        {
            uniform token info:id = "UsdPreviewSurface"
            %(input)s
            token outputs:surface
        }
        %(nodes)s
    }
}
"""
READ = "color3f inputs:diffuseColor.connect = </World/m/r.outputs:result>"
ST = 'texCoord2f[] primvars:st = [(0, 0), (.5, 0), (1, 0), (0, 1), (.5, 1), (1, 1)] (interpolation = "vertex")'


def reader(fallback: str = "float3 inputs:fallback = (.2, .2, .2)", name: str = "tint") -> str:
    return f"""def Shader "r"
        {{
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "{name}"
            {fallback}
            float3 outputs:result
        }}"""


def primvar(values: str, above: str = "", fallback: str = "float3 inputs:fallback = (.2, .2, .2)") -> dict[str, str]:
    return {"card": values, "above": above, "input": READ, "nodes": reader(fallback)}


def texture(output: str = "float3 outputs:rgb", more: str = "", st: str = ST) -> dict[str, str]:
    name = output.split(":")[1]
    nodes = f"""def Shader "t"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./grey.png@
            float2 inputs:st.connect = </World/m/u.outputs:result>
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            {more}
            {output}
        }}
        def Shader "u"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}"""
    return {"card": st, "input": f"color3f inputs:diffuseColor.connect = </World/m/t.outputs:{name}>", "nodes": nodes}


def of(n: int, value: str) -> str:
    return "[" + ", ".join([value] * n) + "]"


# What the stage holds, and what has to be said of it.
CASES: dict[str, tuple[dict[str, str], str]] = {
    "four components": (
        primvar(f'color4f[] primvars:tint = {of(6, "(.8, .1, .8, 1)")} (interpolation = "vertex")'), "",
    ),
    "one value that is no array": (primvar("color3f primvars:tint = (.8, .1, .8)"), ""),
    "the same from above": (primvar("", "color3f primvars:tint = (.8, .1, .8)"), ""),
    "grey": (primvar(f'float[] primvars:tint = {of(6, ".5")} (interpolation = "varying")'), ""),
    "one grey": (primvar("double primvars:tint = .5"), ""),
    "indices": (
        primvar("color3f[] primvars:tint = [(.8, .1, .8), (.1, .1, .8)] (interpolation = \"vertex\")\n"
                "int[] primvars:tint:indices = [0, 0, 1, 0, 0, 1]"), "",
    ),
    "a matrix": (primvar("matrix4d primvars:tint = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))"),
                 "no primvar tint"),
    "texture coordinates": ({"card": ST, "input": READ, "nodes": reader(name="st")}, "no primvar st"),
    "no fallback": (primvar("", fallback=""), "no primvar tint"),
    "a fallback of one number": (primvar("", fallback="float inputs:fallback = .2"), "no primvar tint"),
    "a fallback of four": (primvar("", fallback="float4 inputs:fallback = (.2, .3, .4, 1)"), "no primvar tint"),
    "a colour with alpha": ({"input": "color4f inputs:diffuseColor = (.5, .1, .1, 1)"}, "no usable value"),
    "an array": ({"input": "color3f[] inputs:diffuseColor = [(.5, .1, .1)]"}, "no usable value"),
    "a number": ({"input": "float inputs:diffuseColor = .5"}, "no usable value"),
    "a word": ({"input": 'string inputs:diffuseColor = "red"'}, "no usable value"),
    "itself": ({"input": "color3f inputs:diffuseColor.connect = </World/m/s.inputs:diffuseColor>"}, "leads nowhere"),
    "nothing": (
        {"input": "color3f inputs:diffuseColor = (.5, .1, .1)\n"
                  "color3f inputs:diffuseColor.connect = </World/m/gone.outputs:rgb>"}, "leads nowhere",
    ),
    "one channel of a texture": (texture("float outputs:r"), "is written as constants"),
    "a scale of three": (texture(more="float3 inputs:scale = (.5, .5, .5)"), "scale of /World/m/t has no usable value"),
    "a scale of one": (texture(more="float inputs:scale = .5"), "scale of /World/m/t has no usable value"),
    "constant coordinates": (texture(st=ST.replace("vertex", "constant")), "several values: the first is used"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_was_painted_is_shown(tmp_path: Path, case: str) -> None:
    parts, says = CASES[case]
    write_image(tmp_path / "grey.png", np.full((8, 8, 3), 0.7))
    shot = tmp_path / "shot.usda"
    shot.write_text(STAGE % {"above": "", "card": "", "nodes": "", **parts})
    session = usdslf.open(str(shot), elements=150, bounces=2)
    session.add_stroke(
        usdslf.paint_stroke(
            session.scene, session.tracer, session.camera("/World/cam"), [[(0.40, 0.5), (0.46, 0.5)]], 0.01,
            (0.1, 0.4, 0.05), name="stroke_0001",
        )
    )  # fmt: skip
    session.solve()
    session.author(tmp_path / "look.usda")
    assert session.look is not None and not session.look.not_shown
    scene = scene_under(session.source, tmp_path / "look.usda", None)
    shown = evaluate_surface(scene, np.array([0]), np.full((1, 2), 1 / 3)).diffuse[0]
    np.testing.assert_allclose(shown, PAINTED, atol=0.006)
    assert says in " ".join(session.warnings), session.warnings
