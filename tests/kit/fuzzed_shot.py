"""A small shot that uses much of USD, with its texture and an asset that it references."""

from __future__ import annotations

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


def write_shot(folder: Path) -> Path:
    """Writes the shot into a folder."""
    colors = np.array([[[0.2, 0.5, 0.8], [0.9, 0.4, 0.1]], [[0.3, 0.3, 0.3], [0.6, 0.7, 0.2]]], np.float32)
    write_image(folder / "t.png", colors)
    (folder / "asset.usda").write_text(ASSET)
    (folder / "shot.usda").write_text(SHOT)
    return folder / "shot.usda"
