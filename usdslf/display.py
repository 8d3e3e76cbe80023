"""Display: scene-linear pixels as code values of a screen, as quickly as a viewer shows them.

    DisplaySettings                     what a viewer's controls say: display, view, look, exposure, gamma, channel
    DisplayPass(color, display, ...)    what they come to for one display, view and look
        .codes(pixels, settings)        (h, w, 3) uint8, on the processor
        .shader                         the same as a GLSL function with its look-up table

`Color.display` is the rule: what OpenColorIO makes of a pixel.  An ACES 2 view costs it some 400 ns a pixel, too much
for a picture that moves.  So it is sampled once, at SIZE^3 colours whose channels lie evenly in log2(x + OFFSET), and
between those OpenColorIO interpolates, tetrahedron by tetrahedron, with its own table on the processor and with
its own shader text on the GPU.  Against the rule, over colours 9 stops below to 7 above middle grey at all
saturations: a mean of .04 of an 8-bit code, 99.9 % within 1, the worst (at the rim of a display's gamut) within 6.

Exposure acts before the table and gamma behind it, exactly.  A single channel is shown grey, through the view.  False
colour goes past the view: it tells how bright the scene is, in stops about middle grey after exposure.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import PyOpenColorIO as ocio
from numpy.typing import NDArray

from usdslf.color import LUMINANCE, Color, luminance
from usdslf.errors import InputError
from usdslf.threads import thread_count

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
CHANNELS = ("color", "red", "green", "blue", "luminance", "false_color")
MIDDLE_GREY = 0.18
SIZE = 65  # colours of the table along each axis: a quarter of a million in all
OFFSET = 2.0**-8  # where the table's spacing turns from even in x to even in stops
LOWEST, HIGHEST = -OFFSET / 2, MIDDLE_GREY * 2.0**10  # that the table holds; what is beyond is taken for these
FALSE_COLORS: tuple[tuple[float, tuple[int, int, int], str], ...] = (
    (-np.inf, (48, 0, 72), "black: more than 6 stops below middle grey"),
    (-6.0, (20, 40, 170), "6 to 4 stops below"),
    (-4.0, (30, 120, 190), "4 to 2 stops below"),
    (-2.0, (70, 90, 100), "2 to a half stop below"),
    (-0.5, (40, 160, 60), "middle grey, within half a stop"),
    (0.5, (130, 130, 130), "a half to 1 stop above"),
    (1.0, (230, 150, 160), "1 to 2 stops above"),
    (2.0, (170, 170, 170), "2 to 2.5 stops above"),
    (2.5, (240, 220, 40), "2.5 to 4 stops above: near a display's white"),
    (4.0, (240, 130, 30), "4 to 6 stops above"),
    (6.0, (220, 20, 20), "6 stops above and more"),
)
"""From how many stops about middle grey on, sRGB code values, and what that means: of `false_color`."""
MOST_GAMMAS = 16  # whose tables are kept
NOT_A_NUMBER = (255, 0, 255)  # sRGB code values of what is not finite, in false colour


@dataclass(frozen=True)
class DisplaySettings:
    """How a picture is brought to the screen.

    Attributes:
        display, view: names in the OpenColorIO config; "": its first ones.
        look: of the config; "": the view's own.
        exposure: [stops], before the view.
        gamma: exponent 1 / gamma after the view, above 0.
        channel: one of CHANNELS; red, green, blue and luminance are shown grey.
    """

    display: str = ""
    view: str = ""
    look: str = ""
    exposure: float = 0.0
    gamma: float = 1.0
    channel: str = "color"


@dataclass(frozen=True, eq=False)
class DisplayTexture:
    """A table that a shader reads, the nearest value, as 32-bit floats.

    Attributes:
        name: of the sampler3D in the shader's text.
        values: (SIZE, SIZE, SIZE, 3): of red, green and blue; blue runs quickest, as the first coordinate.
    """

    name: str
    values: F32


@dataclass(frozen=True, eq=False)
class DisplayShader:
    """A display pass as GLSL.

    Attributes:
        text: GLSL 4.0 with `vec3 usdslf_display(vec3 rgb, float exposure, float gamma, int channel)`: working-space
            pixels to display code values 0..1; channel is the number of one of CHANNELS.
        textures: that it reads.
    """

    text: str
    textures: tuple[DisplayTexture, ...]


@dataclass(frozen=True, eq=False)
class DisplayPass:
    """One display, view and look of a config, ready to be applied to pictures.  May be shared between threads.

    Attributes:
        color: conversions into the working space of the shot and out of it.
        display, view, look: names in its config; "" as `Color.display` takes it.
    """

    color: Color
    display: str = ""
    view: str = ""
    look: str = ""

    @staticmethod
    def of(color: Color, settings: DisplaySettings) -> DisplayPass:
        """Returns the one of a viewer's settings: the same object for the same names of the same config.

        Args:
            color: conversions into the working space and out of it.
            settings: exposure, gamma and channel of them do not matter here.
        """
        return _kept(color, settings.display, settings.view, settings.look)

    def codes(self, pixels: NDArray, settings: DisplaySettings) -> U8:
        """Returns a picture as code values of the screen, (h, w, 3), 0..255.

        The first call takes a quarter of a second for the table of the view, more on a busy machine.

        Args:
            pixels: (h, w, 3 or more), scene-linear, in the working space; what is not a number is black.
            settings: exposure, gamma and channel; display, view and look are those of this pass.

        Raises: InputError where the config has no such display, view or look, or there is no such channel.
        """
        check_channel(settings.channel)
        pixels = np.asarray(pixels, np.float32)[..., :3]
        out = np.empty(pixels.shape, np.uint8)
        one = _false_color if settings.channel == "false_color" else self._viewed(settings.gamma)
        gain = np.float32(2.0**settings.exposure)

        def convert(rows: slice) -> None:
            with np.errstate(over="ignore", invalid="ignore"):
                scaled = np.ascontiguousarray(_channel(pixels[rows] * gain, settings.channel))
            if settings.channel != "false_color":
                scaled[np.isnan(scaled).any(-1)] = 0
            one(scaled, out[rows])

        _in_strips(convert, len(pixels))
        return out

    @cached_property
    def shader(self) -> DisplayShader:
        """The same for a GPU; exposure, gamma and channel are arguments of its function.

        Raises: InputError where the config has no such display, view or look.
        """
        described = ocio.GpuShaderDesc.CreateShaderDesc(
            language=ocio.GPU_LANGUAGE_GLSL_4_0, functionName="usdslf_view", resourcePrefix="usdslf_"
        )
        self._processor(1.0).getOptimizedGPUProcessor(ocio.OPTIMIZATION_LOSSLESS).extractGpuShaderInfo(described)
        tables = tuple(
            DisplayTexture(t.samplerName, np.array(t.getValues(), np.float32).reshape(SIZE, SIZE, SIZE, 3))
            for t in described.get3DTextures()
        )
        text = "\n".join([described.getShaderText(), _false_color_glsl(), _DISPLAY_GLSL])
        return DisplayShader(text.replace("%LUMINANCE%", ", ".join(f"{w:g}" for w in LUMINANCE)), tables)

    @cached_property
    def _table(self) -> Any:
        """The view between the colours where it was asked, as an OpenColorIO transform."""
        low, high = np.log2(LOWEST + OFFSET), np.log2(HIGHEST + OFFSET)
        along = (2.0 ** np.linspace(low, high, SIZE) - OFFSET).astype(np.float32)
        # Blue runs quickest in an OpenColorIO table.
        colors = np.stack(np.meshgrid(along, along, along, indexing="ij"), -1).reshape(1, -1, 3)
        shown = self.color.display(colors, display=self.display, view=self.view, look=self.look)
        cube = ocio.Lut3DTransform(SIZE)
        cube.setInterpolation(ocio.INTERP_TETRAHEDRAL)
        cube.setData(shown.reshape(-1))
        slope = float(1 / (high - low))
        spread = ocio.LogAffineTransform(
            logSideSlope=[slope] * 3,
            logSideOffset=[float(-low * slope)] * 3,
            linSideSlope=[1.0] * 3,
            linSideOffset=[OFFSET] * 3,
        )
        spread.setBase(2.0)
        held = ocio.RangeTransform(LOWEST, HIGHEST, LOWEST, HIGHEST)
        return ocio.GroupTransform([held, spread, cube])

    def _processor(self, gamma: float) -> Any:
        steps = ocio.GroupTransform([self._table])
        if gamma != 1.0:
            power = 1.0 / max(gamma, 1e-3)
            steps.appendTransform(ocio.ExponentTransform([power, power, power, 1.0]))
        return ocio.Config.CreateRaw().getProcessor(steps)

    @cached_property
    def _views(self) -> dict[float, Callable[[F32, U8], None]]:
        """By gamma: OpenColorIO takes 6 ms to get a table ready, as long as for a small picture."""
        return {}

    def _viewed(self, gamma: float) -> Callable[[F32, U8], None]:
        """What brings strips of pixels through the view and gamma to code values."""
        view = self._views.get(gamma)
        if view is None:
            if len(self._views) >= MOST_GAMMAS:
                self._views.clear()
            view = self._views[gamma] = self._made_view(gamma)
        return view

    def _made_view(self, gamma: float) -> Callable[[F32, U8], None]:
        run = self._processor(gamma).getOptimizedCPUProcessor(
            ocio.BIT_DEPTH_F32, ocio.BIT_DEPTH_UINT8, ocio.OPTIMIZATION_LOSSLESS
        )

        def convert(pixels: F32, out: U8) -> None:
            height, width = pixels.shape[:2]
            if height and width:
                run.apply(
                    ocio.PackedImageDesc(pixels, width, height, 3),
                    ocio.PackedImageDesc(out, width, height, 3, ocio.BIT_DEPTH_UINT8, 1, 3, 3 * width),
                )

        return convert


@lru_cache(maxsize=8)
def _kept(color: Color, display: str, view: str, look: str) -> DisplayPass:
    return DisplayPass(color, display, view, look)


def check_channel(channel: str) -> None:
    """Raises InputError where there is no such channel."""
    if channel not in CHANNELS:
        raise InputError(f"there is no channel {channel!r}, choose from {', '.join(CHANNELS)}")


def _channel(pixels: F32, channel: str) -> F32:
    """Returns the pixels, or one channel of them as grey."""
    if channel in ("color", "false_color"):
        return pixels
    one = luminance(pixels) if channel == "luminance" else pixels[..., CHANNELS.index(channel) - 1]
    return np.repeat(one[..., None], 3, -1)


def _false_color(pixels: F32, out: U8) -> None:
    """Writes the colour of each pixel's stops about middle grey."""
    light = luminance(pixels)
    from_on = MIDDLE_GREY * 2.0 ** np.array([stops for stops, _, _ in FALSE_COLORS[1:]])
    palette = np.array([*(codes for _, codes, _ in FALSE_COLORS), NOT_A_NUMBER], np.uint8)
    band = np.searchsorted(from_on.astype(np.float32), light, side="right")
    band[~np.isfinite(pixels).all(-1)] = len(FALSE_COLORS)
    out[...] = palette[band]


def _in_strips(convert: Callable[[slice], None], height: int) -> None:
    """Converts strips of rows, one for each processor, side by side."""
    count = max(1, min(thread_count(), height // 64))
    edges = [height * i // count for i in range(count + 1)]
    strips = [slice(a, b) for a, b in pairwise(edges)]
    if count == 1:
        convert(slice(0, height))
        return
    with ThreadPoolExecutor(count) as pool:
        for done in [pool.submit(convert, strip) for strip in strips]:
            done.result()


_DISPLAY_GLSL = """
vec3 usdslf_display(vec3 rgb, float exposure, float gamma, int channel)
{
  rgb *= exp2(exposure);
  if (channel == 5) return usdslf_false_color(rgb);
  if (channel >= 1 && channel <= 3) rgb = vec3(rgb[channel - 1]);
  if (channel == 4) rgb = vec3(dot(rgb, vec3(%LUMINANCE%)));
  if (any(isnan(rgb))) rgb = vec3(0.0);
  vec3 shown = usdslf_view(vec4(rgb, 1.0)).rgb;
  return gamma == 1.0 ? shown : pow(max(shown, vec3(0.0)), vec3(1.0 / max(gamma, 1e-3)));
}
"""


def _false_color_glsl() -> str:
    """The colour of a pixel's stops about middle grey."""
    rows = [
        f"  if (y >= {np.float32(MIDDLE_GREY * 2.0**stops):.9g}) c = vec3({', '.join(map(str, codes))});"
        for stops, codes, _ in FALSE_COLORS[1:]
    ]
    return "\n".join([
        "vec3 usdslf_false_color(vec3 rgb)",
        "{",
        f"  if (any(isnan(rgb)) || any(isinf(rgb))) return vec3({', '.join(map(str, NOT_A_NUMBER))}) / 255.0;",
        "  float y = dot(rgb, vec3(%LUMINANCE%));",
        f"  vec3 c = vec3({', '.join(map(str, FALSE_COLORS[0][1]))});",
        *rows,
        "  return c / 255.0;",
        "}",
    ])  # fmt: skip
