"""Paint how a surface should look; get the smallest material change that explains it, as a USD layer.

The steps, in the order of the flow.  Each is a module of plain functions from frozen records to a record;
only `session` knows the order.

    step            module          from -> to
    ------------    -------------   ---------------------------------------------------------------
    read            usd.read        Usd.Stage, frame -> Scene
    elements        elements        Scene -> Elements: equal-area points with their reflectance
    visibility      visibility      Elements -> Visibility: which element each of 1024 directions sees
    light           light_field     Scene's lights -> light that falls on the elements, edits cannot change it
    light field     light_field     Visibility, static light -> LightField: what the elements send out
    strokes         strokes         a path on the picture -> Stroke: points, colours, eye
    tools           inference       Stroke, LightField -> the radiance that its tool asks for
    evidence        inference       Strokes, LightField -> normal equations of the painted samples
    solve           inference       evidence -> Change: the fewest parameters that explain the strokes
    edits           edits           Change -> before and after of each material input
    author          usd.author      edits -> look layer, review root
    render          render          Scene, LightField, Camera -> picture

Public names; all others may change from version to version:

    open             opens a shot: a path or a Usd.Stage -> Session; steps run when they are needed
    Session          the page of verbs for scripts: add_stroke, solve, author, render, report
    Shot             a shot as it is, shared between threads; made once, never changed
    solve            strokes on a Shot -> a generator of Progress that returns a Solution; close cancels
    stylize_shot     the same, of unsharp masking the whole shot
    run, stepwise    such a generator to its end; any function as such a generator
    author           a Solution -> a look layer, as a Look
    render_shot      pictures of a Shot, or of it under a look
    live_picture     begins a picture that comes at once and gets better, a LivePicture
    LivePicture      yields LiveFrames; makes others of another camera or size, or after an edit
    LiveFrame        the picture so far
    Settings, Solution, Look, Progress, Cancelled      their records
    Stroke           what was painted, and from where, as a record
    paint_stroke     a path on the picture of a camera -> Stroke
    read_strokes     the strokes of a stroke layer
    write_strokes    strokes -> a stroke layer
    Scene            the shot at a frame as numpy records
    UsdslfError      base of all errors that a user can mend, with the exit code of each
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from usdslf.errors import UsdslfError
from usdslf.usd.schema import announce_schema

if TYPE_CHECKING:
    from usdslf.look import Look, author, live_picture, render_shot
    from usdslf.progress import Cancelled, Progress, run, stepwise
    from usdslf.render.live.picture import LiveFrame, LivePicture
    from usdslf.scene.records import Scene
    from usdslf.session import Session, open
    from usdslf.shot import Shot
    from usdslf.solution import Settings, Solution, solve, stylize_shot
    from usdslf.strokes.paint import paint_stroke
    from usdslf.strokes.stroke import Stroke
    from usdslf.usd.stroke_layer import read_strokes, write_strokes

__version__ = "0.1.0"

announce_schema()

__all__ = [
    "Cancelled",
    "LiveFrame",
    "LivePicture",
    "Look",
    "Progress",
    "Scene",
    "Session",
    "Settings",
    "Shot",
    "Solution",
    "Stroke",
    "UsdslfError",
    "__version__",
    "author",
    "live_picture",
    "open",
    "paint_stroke",
    "read_strokes",
    "render_shot",
    "run",
    "solve",
    "stepwise",
    "stylize_shot",
    "write_strokes",
]

# Loaded at first use, so that `usdslf --help` and `usdslf doctor` neither wait for USD nor need OpenCL.
_HOME = {
    "Scene": "usdslf.scene.records",
    "Session": "usdslf.session",
    "open": "usdslf.session",
    "Shot": "usdslf.shot",
    **dict.fromkeys(("Settings", "Solution", "solve", "stylize_shot"), "usdslf.solution"),
    **dict.fromkeys(("Look", "author", "live_picture", "render_shot"), "usdslf.look"),
    **dict.fromkeys(("LiveFrame", "LivePicture"), "usdslf.render.live.picture"),
    **dict.fromkeys(("Cancelled", "Progress", "run", "stepwise"), "usdslf.progress"),
    "Stroke": "usdslf.strokes.stroke",
    "paint_stroke": "usdslf.strokes.paint",
    "read_strokes": "usdslf.usd.stroke_layer",
    "write_strokes": "usdslf.usd.stroke_layer",
}


if not TYPE_CHECKING:  # type checkers are to find unknown names

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'usdslf' has no attribute {name!r}")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
