"""Cloth with metal eyelets: a card whose maps say what is metal, and what plain usd-core says of it under a look."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from kit.stage_parts import StageBuilder, rectangle
from kit.stage_textures import write_image
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdShade

N = 64  # texels on a side
CLOTH, BRASS, ROUGH = (0.12, 0.2, 0.5), (0.9, 0.7, 0.35), (0.7, 0.25)
MATERIAL = "/World/mtl/cloth"
CARD = "/World/card"
F = Sdf.ValueTypeNames


def maps() -> tuple[NDArray, NDArray, NDArray]:
    """Base colours (N, N, 3), metallic and roughness (N, N): woven cloth, 4 x 4 round eyelets."""
    y, x = np.mgrid[0:N, 0:N]
    metal = ((x % 16 - 7.5) ** 2 + (y % 16 - 7.5) ** 2 < 12).astype(np.float32)
    weave = 0.75 + 0.25 * ((x // 2 + y // 2) % 2)
    base = np.where(metal[..., None] > 0, BRASS, np.array(CLOTH) * weave[..., None])
    return base.astype(np.float32), metal, np.where(metal > 0, ROUGH[1], ROUGH[0]).astype(np.float32)


def write_eyelets(folder: Path, tiles: int = 1, **options: object) -> Path:
    """Writes the stage: base colour in one file, roughness and metallic packed in green and blue of another.

    Args:
        folder: exists.
        tiles: 2: a set of two UDIM tiles over a card of two unit squares of st.
        options: wrap (repeat), packed_wrap (as wrap), base (a constant in place of the map), scale (4,) of the packed
            map, ior, clearcoat.
    """
    base, metal, rough = maps()
    packed = np.stack([0 * rough, rough, metal], -1)
    b = StageBuilder(folder)
    for name, pixels in (("base", base), ("packed", packed)):
        for tile in range(tiles):
            suffix = f".{1001 + tile}" if tiles > 1 else ""
            write_image(folder / f"{name}{suffix}.exr", pixels if tile == 0 else pixels[::-1])
    material = UsdShade.Material.Define(b.stage, MATERIAL)
    shader = UsdShade.Shader.Define(b.stage, f"{MATERIAL}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", F.Token))
    reader = UsdShade.Shader.Define(b.stage, f"{MATERIAL}/st")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", F.String).Set("st")
    nodes = {}
    for name in ("base", "packed"):
        node = UsdShade.Shader.Define(b.stage, f"{MATERIAL}/{name}")
        node.CreateIdAttr("UsdUVTexture")
        node.CreateInput("file", F.Asset).Set(f"./{name}.<UDIM>.exr" if tiles > 1 else f"./{name}.exr")
        node.CreateInput("sourceColorSpace", F.Token).Set("raw")
        for wrap in ("wrapS", "wrapT"):
            node.CreateInput(wrap, F.Token).Set(str(options.get(f"{name}_wrap", options.get("wrap", "repeat"))))
        node.CreateInput("st", F.Float2).ConnectToSource(reader.CreateOutput("result", F.Float2))
        nodes[name] = node
    if "scale" in options:
        nodes["packed"].CreateInput("scale", F.Float4).Set(Gf.Vec4f(*options["scale"]))  # type: ignore[misc]
    if "base" in options:
        shader.CreateInput("diffuseColor", F.Color3f).Set(Gf.Vec3f(*options["base"]))  # type: ignore[misc]
    else:
        rgb = nodes["base"].CreateOutput("rgb", F.Float3)
        shader.CreateInput("diffuseColor", F.Color3f).ConnectToSource(rgb)
    for name, channel in (("roughness", "g"), ("metallic", "b")):
        shader.CreateInput(name, F.Float).ConnectToSource(nodes["packed"].CreateOutput(channel, F.Float))
    for name in ("ior", "clearcoat"):
        if name in options:
            shader.CreateInput(name, F.Float).Set(float(options[name]))  # type: ignore[arg-type]
    card = rectangle((-1, 0, 1), (2 * tiles, 0, 0), (0, 0, -2))
    card.uvs[:, 0] *= tiles
    b.mesh("card", card, MATERIAL)
    b.dome_light("dome", 1.0)
    b.camera((0, 3, 0.01), (0, 0, 0), 45)
    return b.save()


def composed(stage: Path, look: Path | None = None) -> Usd.Stage:
    """The look over the stage, as usd-core composes it; the stage alone without one."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(f) for f in (look, stage) if f]
    return Usd.Stage.Open(root)


def texels_of(stage: Usd.Stage, name: str, tile: int = 0, material: str = MATERIAL) -> NDArray:
    """What an input of the material holds at the texels of its map: by usd-core's connections and the file alone."""
    surface = UsdShade.Material(stage.GetPrimAtPath(material)).ComputeSurfaceSource()[0]
    port = surface.GetInput(name)
    sources = port.GetValueProducingAttributes() if port else []
    if not sources:
        default = {"ior": 1.5, "useSpecularWorkflow": 0, "metallic": 0.0, "specularColor": (0, 0, 0)}[name]
        return np.asarray(default, np.float64)
    if not UsdShade.Output.IsOutput(sources[0]):
        return np.asarray(sources[0].Get(), np.float64)
    node = UsdShade.Shader(sources[0].GetPrim())
    asset = node.GetInput("file").Get()
    layers = [s.layer for s in node.GetInput("file").GetAttr().GetPropertyStack()]
    path = asset.resolvedPath or layers[0].ComputeAbsolutePath(asset.path).replace("<UDIM>", str(1001 + tile))
    image = oiio.ImageBuf(path)
    pixels = np.asarray(image.get_pixels(oiio.FLOAT), np.float64)
    if image.spec().format == oiio.UINT8 and (node.GetInput("sourceColorSpace").Get() or "auto") != "raw":
        pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    values = [node.GetInput(n).Get() if node.GetInput(n) else None for n in ("scale", "bias")]
    scale, bias = (np.array(v if v is not None else (d,) * 4) for v, d in zip(values, (1.0, 0.0)))
    channels = ["rgba".index(c) for c in sources[0].GetName().rpartition(":")[2]]
    return pixels[..., channels] * scale[channels] + bias[channels]


def at_texels(pixels: NDArray, n: int = N) -> NDArray:
    """A finer map (k n, k n, C) at the middles of the n x n texels; a constant as it is."""
    if pixels.ndim < 2:
        return pixels
    k = len(pixels) // n
    low = (k - 1) // 2
    rows = pixels[low::k] if k % 2 else 0.5 * (pixels[low::k] + pixels[low + 1 :: k])
    return rows[:, low::k] if k % 2 else 0.5 * (rows[:, low::k] + rows[:, low + 1 :: k])


def reflects(stage: Usd.Stage, tile: int = 0, material: str = MATERIAL, n: int = N) -> tuple[NDArray, NDArray]:
    """Diffuse colour and F0 (n, n, 3) of a material's texels, by the formulas of previewSurface.glslfx."""

    def of(name: str) -> NDArray:
        return at_texels(texels_of(stage, name, tile, material), n)

    base = np.broadcast_to(of("diffuseColor"), (n, n, 3))
    if of("useSpecularWorkflow"):
        return base, np.broadcast_to(of("specularColor"), (n, n, 3))
    m, ior = of("metallic"), of("ior")
    r2 = ((1 - ior) / (1 + ior)) ** 2
    s = 1 - m + m * base
    return base * (1 - m), s * (r2 * (1 - m) + m)
