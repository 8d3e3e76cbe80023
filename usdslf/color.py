"""Colour: every conversion is OpenColorIO's.

Config: what was asked for (`--ocio`), else `$OCIO`, else `ocio://default`.  Working space: the
scene-linear space that the shot is rendered in, `lin_rec709_scene` unless the stage says otherwise.
Names that the config lacks are looked up in OpenColorIO's built-in config, so that USD's own names
(`lin_ap1_scene`, `srgb_rec709_scene`, ...) and `sRGB`, `raw` work with any config.
"""

from __future__ import annotations

import os
import re
from functools import lru_cache
from typing import Any

import numpy as np
import PyOpenColorIO as ocio
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import InputError

F32 = NDArray[np.float32]
BUILT_IN = "ocio://default"
USD_DEFAULT_SPACE = "lin_rec709_scene"
# What UsdUVTexture and older files call spaces that OpenColorIO names otherwise.
_SYNONYMS = {"sRGB": "srgb_rec709_scene", "srgb": "srgb_rec709_scene", "linear": USD_DEFAULT_SPACE}
_DATA = ("", "raw", "Raw", "data", "identity", "unknown")


class Color:
    """Conversions into and out of one working space by one OpenColorIO config; `color_of` makes them once.

    Attributes:
        config: as it was asked for, "" where it was not.
        config_name: the resolved name, to be recorded with results.
        working_space: name of the scene-linear space of all pixels inside the program.
        display_name, view_name: what `display` uses unless told otherwise.
    """

    def __init__(self, config: str | None, working_space: str) -> None:
        """Reads the config.

        Args:
            config, working_space: as of `color_of`.

        Raises: InputError where the config cannot be used, or lacks the space.
        """
        origin, path = "--ocio", config
        if not path:
            origin, path = "$OCIO", os.environ.get("OCIO")
        if not path:
            origin, path = "the built-in config", BUILT_IN
        try:
            self._config = ocio.Config.CreateFromFile(path)
            self._config.validate()
        except (ocio.Exception, ocio.ExceptionMissingFile) as e:
            reason = " ".join(str(e).split()).rstrip(".")
            raise InputError(
                f"{path} (from {origin}) cannot be used as an OpenColorIO config, "
                f"name a config.ocio file or {BUILT_IN}: {reason}"
            ) from None
        self._built_in = ocio.Config.CreateFromFile(BUILT_IN)
        self.config_name: str = self._config.getName() or str(path)
        self.config, self.working_space = config or "", working_space
        if not self.knows(working_space):
            raise InputError(
                f"working space {working_space} is not in {self.config_name}, "
                f"author another renderingColorSpace or use another --ocio"
            )
        self.display_name: str = self._config.getDefaultDisplay()
        self.view_name: str = self._config.getDefaultView(self.display_name)
        self._processors: dict[tuple[str, str], ocio.CPUProcessor | None] = {}

    @property
    def cache_id(self) -> str:
        """Names all that the conversions into the working space depend on, files of look-up tables too."""
        return f"{self._config.getCacheID()} {self._built_in.getCacheID()} {self.working_space}"

    # ---- names -----------------------------------------------------------------------------
    def knows(self, space: str) -> bool:
        """Returns whether `space` names a colour space, a role or data."""
        name = _SYNONYMS.get(space, space)
        return space in _DATA or any(c.getColorSpace(name) for c in (self._config, self._built_in))

    def is_data(self, space: str) -> bool:
        """Returns whether pixels of `space` are numbers that no conversion may touch."""
        if space in _DATA:
            return True
        found = self._config.getColorSpace(_SYNONYMS.get(space, space))
        return bool(found and found.isData())

    def displays(self) -> dict[str, list[str]]:
        """Returns the views of each display, the default ones first."""
        names = sorted(self._config.getActiveDisplays(), key=lambda d: d != self.display_name)
        names = [n for n in names if n] or [self.display_name]
        return {d: list(self._config.getViews(d)) for d in names}

    def default_view(self, display: str) -> str:
        """Returns the name of the view that a display has unless told otherwise."""
        return str(self._config.getDefaultView(display))

    def looks(self) -> list[str]:
        """Returns the names of the looks that can be put in place of a view's own."""
        return [str(look.getName()) for look in self._config.getLooks()]

    # ---- conversions -----------------------------------------------------------------------
    def to_working(self, pixels: ArrayLike, space: str) -> F32:
        """Returns pixels (n, 3) of a space in the working space.

        Args:
            pixels: (n, 3), or of any shape whose last axis is 3 or 4; alpha stays as it is.
            space: an OpenColorIO space, role or synonym.
        """
        return self._apply(pixels, space, self.working_space)

    def from_working(self, pixels: ArrayLike, space: str) -> F32:
        """Returns working-space pixels (n, 3) in a space.

        Args:
            pixels: (n, 3), or of any shape whose last axis is 3 or 4; alpha stays as it is.
            space: an OpenColorIO space, role or synonym.
        """
        return self._apply(pixels, self.working_space, space)

    def display(
        self,
        pixels: ArrayLike,
        exposure: float = 0.0,
        gamma: float = 1.0,
        display: str = "",
        view: str = "",
        invert: bool = False,
        look: str = "",
    ) -> F32:
        """Returns working-space pixels (n, 3) as display code values, as a viewer shows them.

        Args:
            pixels: (n, 3), or of any shape whose last axis is 3 or 4, scene-linear; what is not finite is shown black.
            exposure: [stops], before the view.
            gamma: exponent 1 / gamma after the view.
            display, view: names in the config; default its first ones.
            invert: from display code values back to scene-linear; display white can become very large.
            look: name in the config, or several as OpenColorIO writes them, in place of the view's own; default that.

        Raises:
            InputError: the config has no such display, view or look.
        """
        display = display or self.display_name
        view = view or self._config.getDefaultView(display)
        out = np.nan_to_num(np.array(pixels, np.float32), nan=0.0, posinf=65504.0, neginf=0.0)
        source = self.working_space
        if not self._config.getColorSpace(source):
            source = self._config.getRoleColorSpace("scene_linear") or source
        transform = ocio.DisplayViewTransform(src=source, display=display, view=view)
        pipeline = ocio.LegacyViewingPipeline()
        pipeline.setDisplayViewTransform(transform)
        if look:
            pipeline.setLooksOverrideEnabled(True)
            pipeline.setLooksOverride(look)
        gain = float(2.0**exposure)
        pipeline.setLinearCC(ocio.MatrixTransform.Scale([gain, gain, gain, 1.0]))
        power = 1.0 / max(gamma, 1e-3)
        pipeline.setDisplayCC(ocio.ExponentTransform([power, power, power, 1.0]))
        try:
            processor = pipeline.getProcessor(self._config, self._config.getCurrentContext())
        except ocio.Exception:
            known = self.looks()
            if look and not any(part.strip(" +-") in known for part in re.split("[,|]", look)):
                has = f"it has {', '.join(known)}" if known else "it has none at all"
                raise InputError(f"{self.config_name} has no look {look!r}, {has}") from None
            raise InputError(
                f"{self.config_name} has no display {display!r} with view {view!r}, "
                f"it has {', '.join(self.displays())}"
            ) from None
        if invert:
            group = processor.createGroupTransform()
            processor = self._config.getProcessor(group, ocio.TRANSFORM_DIR_INVERSE)
            out = _run(processor.getDefaultCPUProcessor(), out)
            return self._apply(out, source, self.working_space)
        return _run(processor.getDefaultCPUProcessor(), self._apply(out, self.working_space, source))

    def converts(self, space: str) -> bool:
        """Returns whether pixels of `space` are other numbers in the working space."""
        return self._processor(space, self.working_space) is not None

    def acts_per_channel(self, space: str) -> bool:
        """Returns whether the conversion from `space` treats the channels alike and apart (a table can hold it)."""
        processor = self._processor(space, self.working_space)
        return processor is None or not processor.hasChannelCrosstalk()

    def _apply(self, pixels: ArrayLike, source: str, target: str) -> F32:
        out = np.array(pixels, np.float32, order="C")
        processor = self._processor(source, target)
        return out if processor is None else _run(processor, out)

    def _processor(self, source: str, target: str) -> Any:
        """The CPU processor between two spaces, None where nothing is to be done."""
        key = (source, target)
        if key not in self._processors:
            self._processors[key] = self._make_processor(source, target)
        return self._processors[key]

    def _make_processor(self, source: str, target: str) -> Any:
        for name in (source, target):
            if not self.knows(name):
                raise InputError(f"colour space {name!r} is not in {self.config_name}, name one that is")
        if source == target or self.is_data(source) or self.is_data(target):
            return None
        a, b = (_SYNONYMS.get(n, n) for n in (source, target))
        here, built_in = self._config, self._built_in
        try:
            if here.getColorSpace(a) and here.getColorSpace(b):
                processor = here.getProcessor(a, b)
            elif here.getColorSpace(b):
                processor = ocio.Config.GetProcessorFromBuiltinColorSpace(a, here, b)
            elif here.getColorSpace(a):
                processor = ocio.Config.GetProcessorToBuiltinColorSpace(here, a, b)
            else:
                processor = built_in.getProcessor(a, b)
        except ocio.Exception as e:  # a file of a look-up table is missing, or a role that ties it to other configs
            reason = " ".join(str(e).split()).rstrip(".")
            raise InputError(
                f"{self.config_name} cannot convert {source} to {target}, mend it or use another --ocio: {reason}"
            ) from None
        if processor.isNoOp():
            return None
        # Lossless: the default takes a fast, coarse power function.
        return processor.getOptimizedCPUProcessor(ocio.OPTIMIZATION_LOSSLESS)


def _run(processor: Any, pixels: F32) -> F32:
    """Applies a processor to pixels (..., 3 or 4), which are overwritten where that is possible."""
    if pixels.shape[-1] not in (3, 4):
        raise InputError(f"pixels with {pixels.shape[-1]} channels have no colour, give 3 or 4")
    if pixels.size:
        (processor.applyRGB if pixels.shape[-1] == 3 else processor.applyRGBA)(pixels)
    return pixels


@lru_cache(maxsize=16)
def _color(config: str, environment: str, changed: tuple[int, int], working_space: str) -> Color:
    return Color(config or None, working_space)


def color_of(config: str | None, working_space: str) -> Color:
    """Returns the `Color` of a config and a working space: the same object until the config's file changes.

    Args:
        config: OpenColorIO config, a file or a name that it knows; None or "": $OCIO, else the built-in one.
        working_space: scene-linear space of all pixels inside the program; `Scene.working_space` of a shot.

    Raises:
        InputError: the config cannot be used, or lacks the space.
    """
    environment = os.environ.get("OCIO", "")
    return _color(config or "", environment, _stamp(config or environment), working_space)


def _stamp(path: str) -> tuple[int, int]:
    """Time of last change and size of a file, zeros where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear Rec. 709, for importance and comparison only


def luminance(color: NDArray) -> NDArray[np.float32]:
    """Returns the luminance of (..., 3) linear colours."""
    return np.asarray(color, np.float32) @ LUMINANCE.astype(np.float32)
