"""The real stages beside the repository, by what they hold."""

from __future__ import annotations

MAYA = "preview_surface_mayausd"
CAR = "vehicles_usdwg/USD_Mini_Car_Kit"
VEHICLES = ("4wd", "ambulance", "formula", "sedan", "tractor", "truckFlat", "van")
WHEELS = ("wheelBlack", "wheelLargeRim", "wheelNormal", "wheelRed", "wheelVintage", "wheelWide")
LIT = (  # bring light of their own
    "cornell_box/cornell-box.usda",
    "living_room_godot/living_room.usda",
    "shaderball_usdwg/layers/environment.usda",
    "shaderball_usdwg/standard_shader_ball_scene.usda",
)
UNLIT = (  # shown in the default light
    "avocado/avocado.usda",
    "cornell_box/cornell-box_displayColor.usda",
    "dutch_ship_polyhaven/dutch_ship_medium.usdc",
    f"{MAYA}/UsdPreviewSurface/DisplayColorCube.usda",
    f"{MAYA}/UsdPreviewSurface/F0_is_base.usda",
    f"{MAYA}/UsdPreviewSurface/LightAPI_Test.usda",
    f"{MAYA}/UsdPreviewSurface/TestFallbackColor.usda",
    f"{MAYA}/UsdPreviewSurface/TestOpacityThreshold.usda",
    f"{MAYA}/UsdPreviewSurface/UsdTransform2dTest.usda",
    f"{MAYA}/UsdPreviewSurface/UseSpecularWorkflowTest.usda",
    f"{MAYA}/multipleMaterialsAssignment/MultipleMaterialsAssignment.usda",
    f"{MAYA}/normals/primvars_normals.usda",
    "shaderball_usdwg/layers/shaderball.usda",
    "teapot_usdwg/DrawModes.usd",
    "teapot_usdwg/Teapot.usd",
    "teapot_usdwg/geo/FancyTeapot.usd",
    "teapots_instanced_usdwg/assets/teapot/teapot.usd",
    "teapots_instanced_usdwg/scenes/teapotScene.usd",
    "teapots_instanced_usdwg/scenes/teapotScene_layout.usd",
    f"{CAR}/assets/vehicles/vehicleVariants.usda",
    *(f"{CAR}/assets/vehicles/{v}/asset/{v}FullAsset.usda" for v in VEHICLES),
    f"{CAR}/assets/wheels/wheelVariants.usda",
)
LAYERS = (  # of these stages, with geometry: read, but not shown
    "teapot_usdwg/Teapot_Geometry.usd",
    "teapot_usdwg/Teapot_Materials.usd",
    "teapot_usdwg/Teapot_Payload.usd",
    "teapot_usdwg/geo/UtahTeapot.usd",
    "teapots_instanced_usdwg/assets/teapot/geo.usd",
    "teapots_instanced_usdwg/assets/teapot/geo/UtahTeapot.usd",
    "teapots_instanced_usdwg/assets/teapot/mtl.usd",
    "teapots_instanced_usdwg/assets/teapot/payload.usd",
    *(f"{CAR}/assets/vehicles/{v}/asset/{v}BodyAsset.usda" for v in VEHICLES),
    *(f"{CAR}/assets/wheels/{w}/asset/{w}Asset.usda" for w in WHEELS),
)
