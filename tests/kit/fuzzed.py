"""A small shot that uses much of USD, and faults of its text: bytes, tokens, lines, ends.

    write_shot(folder) -> Path            the shot, with its texture and an asset that it references
    fault(text, random) -> bytes          one to three faults
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from usdslf.textures.images import write_image

SHOT = """#usda 1.0
(
    customLayerData = {
        string by = "hand"
        double[] numbers = [1, 2]
    }
    defaultPrim = "World"
    endTimeCode = 4
    metersPerUnit = 1
    startTimeCode = 1
    timeCodesPerSecond = 24
    upAxis = "Y"
)

class "_chair"
{
    color3f[] primvars:displayColor = [(.2, .4, .6)]
}

def Xform "World" (
    kind = "component"
)
{
    def Camera "cam"
    {
        float focalLength = 35
        float horizontalAperture = 36
        float verticalAperture = 20.25
        float2 clippingRange = (0.01, 1000)
        token projection = "perspective"
        double3 xformOp:translate.timeSamples = {
            1: (0, 1, 6),
            4: (0.1, 1, 6),
        }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def DomeLight "sky" (
        prepend apiSchemas = ["CollectionAPI"]
    )
    {
        color3f inputs:color = (.9, .95, 1)
        float inputs:intensity = 1
        float inputs:exposure = 0
        asset inputs:texture:file = @./t.png@
        token inputs:texture:format = "latlong"
    }

    def RectLight "lamp" (
        prepend apiSchemas = ["ShapingAPI"]
    )
    {
        float inputs:width = 1
        float inputs:height = 2
        float inputs:intensity = 4
        bool inputs:normalize = 1
        float inputs:shaping:cone:angle = 60
        float inputs:shaping:cone:softness = 0.1
        float inputs:shaping:focus = 1
        double3 xformOp:translate = (0, 3, 1)
        float3 xformOp:rotateXYZ = (-90, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }

    def SphereLight "bulb"
    {
        float inputs:radius = 0.1
        bool inputs:enableColorTemperature = 1
        float inputs:colorTemperature = 4000
        matrix4d xformOp:transform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (2, 2, 2, 1) )
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }

    def DistantLight "sun"
    {
        float inputs:angle = 0.53
        float inputs:intensity = 100
    }

    def Mesh "floor" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        float3[] extent = [(-2, 0, -2), (2, 0, 2)]
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(-2, 0, 2), (0, 0, 2), (2, 0, 2), (-2, 0, -2), (0, 0, -2), (2, 0, -2)]
        normal3f[] normals = [(0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)] (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st = [(0, 0), (.5, 0), (1, 0), (0, 1), (.5, 1), (1, 1)] (
            interpolation = "vertex"
        )
        color3f[] primvars:tint = [(.5, .2, .1), (.1, .2, .5)] (
            interpolation = "uniform"
        )
        int[] primvars:tint:indices = [1, 0]
        uniform token subdivisionScheme = "none"
        uniform token orientation = "rightHanded"
        rel material:binding = </World/mtl/wood>
        uniform token subsetFamily:materialBind:familyType = "nonOverlapping"

        def GeomSubset "left" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0]
            rel material:binding = </World/mtl/painted>
        }
    }

    def Mesh "cage" (
        prepend apiSchemas = ["MaterialBindingAPI"]
        inherits = </_chair>
    )
    {
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 2, 6, 4, 1, 5, 7, 3, 0, 4, 5, 1, 2, 3, 7, 6]
        point3f[] points.timeSamples = {
            1: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 1)],
        }
        int[] creaseIndices = [0, 1]
        int[] creaseLengths = [2]
        float[] creaseSharpnesses = [3]
        int[] holeIndices = [5]
        rel material:binding = </World/mtl/metal>
        double3 xformOp:scale = (.5, .5, .5)
        uniform token[] xformOpOrder = ["xformOp:scale"]
    }

    def Sphere "ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        double radius = 0.4
        rel material:binding = </World/mtl/plain>
        double3 xformOp:translate = (-1, .4, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }

    def PointInstancer "stones"
    {
        rel prototypes = [</World/stones/stone>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(1, .1, 1), (1.4, .1, .6)]
        quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (.5, .5, .5)]
        int64[] invisibleIds = [7]

        def Cube "stone"
        {
            double size = .2
            color3f[] primvars:displayColor = [(.3, .3, .2)]
        }
    }

    def Xform "chair" (
        instanceable = true
        prepend references = @./asset.usda@</chair>
        variants = {
            string wood = "oak"
        }
        prepend variantSets = "wood"
    )
    {
        double3 xformOp:translate = (0, 0, -1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "wood" = {
            "oak" {
                token visibility = "inherited"
            }
            "ash" {
                token visibility = "invisible"
            }
        }
    }

    def BasisCurves "wire"
    {
        uniform token type = "linear"
        int[] curveVertexCounts = [2]
        point3f[] points = [(0, 0, 0), (0, 2, 0)]
        float[] widths = [.05] (
            interpolation = "constant"
        )
    }

    def Scope "mtl"
    {
        def Material "wood"
        {
            float inputs:rough = .4
            token outputs:surface.connect = </World/mtl/wood/pbr.outputs:surface>

            def Shader "pbr"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/mtl/wood/file.outputs:rgb>
                float inputs:roughness.connect = </World/mtl/wood.inputs:rough>
                normal3f inputs:normal = (0, 0, 1)
                token outputs:surface
            }

            def Shader "file"
            {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./t.png@
                float4 inputs:scale = (1, 1, 1, 1)
                float4 inputs:bias = (0, 0, 0, 0)
                float4 inputs:fallback = (.2, .2, .2, 1)
                token inputs:wrapS = "repeat"
                token inputs:wrapT = "repeat"
                token inputs:sourceColorSpace = "auto"
                float2 inputs:st.connect = </World/mtl/wood/turn.outputs:result>
                float3 outputs:rgb
            }

            def Shader "turn"
            {
                uniform token info:id = "UsdTransform2d"
                float2 inputs:in.connect = </World/mtl/wood/st.outputs:result>
                float inputs:rotation = 10
                float2 inputs:scale = (2, 2)
                float2 inputs:translation = (0, .1)
                float2 outputs:result
            }

            def Shader "st"
            {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 inputs:fallback = (0, 0)
                float2 outputs:result
            }
        }

        def Material "painted"
        {
            token outputs:surface.connect = </World/mtl/painted/pbr.outputs:surface>

            def Shader "pbr"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/mtl/painted/tint.outputs:result>
                int inputs:useSpecularWorkflow = 1
                color3f inputs:specularColor = (.04, .04, .04)
                float inputs:opacity = 1
                float inputs:opacityThreshold = 0
                token outputs:surface
            }

            def Shader "tint"
            {
                uniform token info:id = "UsdPrimvarReader_float3"
                string inputs:varname = "tint"
                float3 inputs:fallback = (.1, .1, .1)
                float3 outputs:result
            }
        }

        def Material "metal"
        {
            token outputs:surface.connect = </World/mtl/metal/pbr.outputs:surface>

            def Shader "pbr"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (.9, .6, .3)
                float inputs:metallic.timeSamples = {
                    1: 1,
                }
                float inputs:roughness = .3
                float inputs:clearcoat = .5
                float inputs:ior = 1.5
                float inputs:displacement = 0
                token outputs:surface
            }
        }

        def Material "plain"
        {
            token outputs:surface.connect = </World/mtl/plain/pbr.outputs:surface>

            def Shader "pbr"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (.3, .5, .2)
                color3f inputs:emissiveColor = (0, 0, 0)
                token outputs:surface
            }
        }
    }
}
"""
ASSET = """#usda 1.0
(
    defaultPrim = "chair"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "chair"
{
    def Cube "seat"
    {
        double size = .3
    }
}
"""
_TOKEN = re.compile(r'"[^"\n]*"|@[^@\n]*@|<[^>\n]*>|[-+.\w:]+|[^\s\w]')
_NUMBERS = (
    *("nan", "inf", "-inf", "1e39", "-1e308", "-1", "0", "2147483647", "99999", "1e-30", "[]", "None", '"x"', "()"),
    *("nan", "inf", "-1", "0", "3", "1e30", "-7", "1000"),
)
_TYPES = (
    *("float", "double", "int", "bool", "token", "string", "asset", "color3f", "float2", "float3", "float4", "half3"),
    *("point3f[]", "int[]", "float[]", "token[]", "string[]", "texCoord2f[]", "texCoord3f[]", "matrix4d", "quatf"),
    *("timecode", "int64[]", "uchar[]", "color4f", "vector3d[]", "opaque", "group", "dictionary", "pathExpression"),
)
_BYTES = (0, 9, 10, 34, 40, 41, 60, 62, 64, 91, 93, 123, 125, 0x80, 0xC3, 0xE9, 0xFE, 0xFF)
Random = np.random.Generator
NAMES = frozenset(t.removesuffix("[]") for t in _TYPES)


def write_shot(folder: Path) -> Path:
    """Writes the shot into a folder."""
    colors = np.array([[[0.2, 0.5, 0.8], [0.9, 0.4, 0.1]], [[0.3, 0.3, 0.3], [0.6, 0.7, 0.2]]], np.float32)
    write_image(folder / "t.png", colors)
    (folder / "asset.usda").write_text(ASSET)
    (folder / "shot.usda").write_text(SHOT)
    return folder / "shot.usda"


def fault(text: str, random: Random) -> bytes:
    """Returns the text of a layer with one to three faults: of how it is written, or in what it says."""
    written: list[Callable[[bytes, Random], bytes]] = [_bytes, _stray, _tokens, _lines, _end]
    said: list[Callable[[bytes, Random], bytes]] = [_numbers, _values, _values, _types, _names, _lines]
    kinds = written if random.random() < 0.3 else said
    data = text.encode()
    for _ in range(random.integers(1, 4)):
        data = kinds[random.integers(len(kinds))](data, random)
    return data


def _bytes(data: bytes, random: Random) -> bytes:
    """Some bytes are others, missing, or too many."""
    for _ in range(random.integers(1, 4)):
        at, new = int(random.integers(len(data) + 1)), random.integers(256, size=random.integers(3), dtype=np.uint8)
        data = data[:at] + new.tobytes() + data[at + int(random.integers(3)) :]
    return data


def _stray(data: bytes, random: Random) -> bytes:
    """A byte that means something to the reader of text, inside of a name, a string or a path."""
    places = [m.start() + 1 for m in re.finditer(rb'["@<\w][\w./]', data)] or [0]
    at = places[random.integers(len(places))]
    return data[:at] + bytes([_BYTES[random.integers(len(_BYTES))]]) + data[at:]


def _tokens(data: bytes, random: Random) -> bytes:
    """A token is missing, twice there, or in the place of another."""
    text = data.decode("latin-1")
    found = list(_TOKEN.finditer(text))
    if not found:
        return data
    one, other = (found[random.integers(len(found))] for _ in range(2))
    new = ("", one[0] * 2, other[0])[random.integers(3)]
    return (text[: one.start()] + new + text[one.end() :]).encode("latin-1")


def _numbers(data: bytes, random: Random) -> bytes:
    """A number is one that nobody expects."""
    return _swapped(data, r"(?<![\w.])-?[\d.]+", _NUMBERS, random)


def _types(data: bytes, random: Random) -> bytes:
    """A value has another type."""
    return _swapped(data, rf"\b({'|'.join(sorted(NAMES))})(\[\])?(?= [\w:]+)", _TYPES, random)


def _values(data: bytes, random: Random) -> bytes:
    """A value is none, empty, short, long, or that of another attribute; the layer can still be parsed."""
    lines = data.split(b"\n")
    stands = re.compile(rb"\s+(uniform )?[\w\[\]]+ [\w:]+(\.connect)? = .*[^({]$")
    at = [i for i, line in enumerate(lines) if stands.match(line)]
    if not at:
        return data
    i, other = at[random.integers(len(at))], at[random.integers(len(at))]
    name, _, value = lines[i].partition(b" = ")
    kind = name.split()[-2]
    if value.startswith(b"["):
        items = re.findall(rb"\([^()]*\)|[^,\[\]]+", value[1:-1])
        items = [x for x in items if x.strip()]
        new = [b"None", b"[]", b"[" + b", ".join(items[:-1]) + b"]", b"[" + b", ".join(items * 2) + b"]"]
        new.append(b"[" + b", ".join(re.sub(rb"[-.\d]+", b"nan", x) for x in items) + b"]")
        new.append(b"[" + b", ".join(re.sub(rb"[-.\d]+", b"-3", x) for x in items) + b"]")
    else:
        extremes = (b"nan", b"inf", b"-1", b"0", b"1e30", b"1e-30", b"100000")
        number = extremes[random.integers(len(extremes))]
        new = [b"None", re.sub(rb"(?<![\w.])-?[.\d]+", number, value), re.sub(rb"[.\d]+", b"0", value, count=1)]
    if lines[other].split()[-1:] and kind == lines[other].partition(b" = ")[0].split()[-2]:
        new.append(lines[other].partition(b" = ")[2])
    lines[i] = name + b" = " + new[random.integers(len(new))]
    return b"\n".join(lines)


def _names(data: bytes, random: Random) -> bytes:
    """A name in a path, a string or a declaration is that of something else."""
    found = list(re.finditer(rb"(?<=[/\" ])[A-Za-z_]\w+(?=[\"/.>]| = )", data))
    if not found:
        return data
    one, other = (found[random.integers(len(found))] for _ in range(2))
    return data[: one.start()] + other[0] + data[one.end() :]


def _swapped(data: bytes, pattern: str, choices: tuple[str, ...], random: Random) -> bytes:
    text = data.decode("latin-1")
    found = list(re.finditer(pattern, text))
    if not found:
        return data
    one = found[random.integers(len(found))]
    return (text[: one.start()] + choices[random.integers(len(choices))] + text[one.end() :]).encode("latin-1")


def _lines(data: bytes, random: Random) -> bytes:
    """A line is missing, twice there, or elsewhere."""
    lines = data.split(b"\n")
    at = int(random.integers(len(lines)))
    line = lines[at]
    what = random.integers(3)
    if what != 1:
        del lines[at]
    if what:
        lines.insert(at if what == 1 else int(random.integers(len(lines) + 1)), line)
    return b"\n".join(lines)


def _end(data: bytes, random: Random) -> bytes:
    """The rest is missing."""
    return data[: int(random.integers(len(data) + 1))]
