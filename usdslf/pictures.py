"""Pictures of a shot as it is, or under a look.

    render_shot(shot, camera, look, ...)            final ones
    live_picture(shot, camera, look, ...)           one that comes at once and gets better

Both tell how far they are (progress.py); as generators that `close` cancels: `stepwise(lambda: render_shot(...))`.
What solves and authors is not loaded for them.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.ahead import built_ahead
from usdslf.progress import step, tell, tell_during
from usdslf.render.live.ahead import programs_of_pictures
from usdslf.render.live.picture import LivePicture
from usdslf.scene.records import Camera
from usdslf.shot import Shot

if TYPE_CHECKING:
    from usdslf.look import Look, PathLike


def render_shot(
    shot: Shot, camera: Camera | str | None = None, look: Look | PathLike | None = None,
    size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (), samples: int = 16, **options: Any,
) -> dict[str, NDArray[np.float32]]:  # fmt: skip
    """Renders a shot as it is, or under a look.

    Args:
        shot: it keeps its light field.
        camera: one, or its path; None: the shot's first, or one that sees everything.
        look: None: as the shot is.  What is rendered more than once is better kept: `shot.edited(look)`.
        size: width and height [pixels].
        aovs: further layers, names of `usdslf.render.picture.AOVS`.
        samples: gathered rays a pixel.
        options: of `usdslf.render.picture.PictureOptions`.

    Returns: name -> (height, width, channels), scene-linear; `color` first.

    Raises: StageError for an unknown camera, InputError for a look that cannot be read, a size or an AOV.
    """
    from usdslf.render.picture import PictureOptions, render_bands  # late: live ones need none of it

    if look is not None:
        shot = shot.edited(_path_of(look))
    view = camera if isinstance(camera, Camera) else shot.camera(camera)
    lit = shot.lit
    asked = PictureOptions(samples, shot.element_count, **options)

    def render() -> dict[str, NDArray[np.float32]]:
        for share, pictures in render_bands(lit, view, size, ("color", *aovs), asked):  # noqa: B007
            tell(share)
        return pictures

    with step("render", shot.seconds):
        return tell_during(render)


def live_picture(
    shot: Shot, camera: Camera | str | None = None, look: Look | PathLike | None = None,
    size: tuple[int, int] = (640, 360), hide_lights: bool = False, region: tuple[int, int, int, int] | None = None,
) -> LivePicture:  # fmt: skip
    """Begins a picture of a shot that comes at once and gets better, for who looks at it and changes things.

    Args:
        shot: it keeps its light field.
        camera: one, or its path; None: the shot's first, or one that sees everything.
        look: None: as the shot is.
        size: width and height [pixels].
        hide_lights: lights and domes are not seen by the camera.
        region: left, top, right, bottom [pixels], of which the picture is; None: the whole.

    Returns: a LivePicture; it makes others of another camera, another size or part, or after an edit.

    Raises: StageError for an unknown camera, InputError for a look that cannot be read, a size or a region.
    """
    if look is not None:
        shot = shot.edited(_path_of(look))
    with built_ahead(shot.device_name, programs_of_pictures(shot.model)):
        if shot.kept:
            shot.kept.name_all()
        shot.later_tracer.begin()
        view = camera if isinstance(camera, Camera) else shot.camera(camera)
        lit, lights = shot.lit, shot.light_set
    with step("render", shot.seconds):
        return tell_during(lambda: LivePicture.of(lit, lights, view, size, hide_lights, region))


def _path_of(look: Look | PathLike) -> PathLike:
    return look if isinstance(look, (str, os.PathLike)) else look.path
