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
    Remark, About    a sentence of a Solution's warnings that knows which strokes it is about, and its kind
    Stroke           what was painted, and from where, as a record
    TOOLS, MODES, SPACES, NORMS, SCOPES     what its attributes may be
    paint_stroke     a path on the picture of a camera -> Stroke
    next_name        the name of the stroke that is painted after others
    frame_of         the frame that strokes are to be looked at
    read_strokes     the strokes of a stroke layer
    write_strokes    strokes -> a stroke layer
    Scene, Camera    the shot at a frame as numpy records
    Color, color_of  conversions of an OpenColorIO config, to the display too
    project_points, camera_rays, film_aspect     between the world and the picture of a camera
    DisplayPass, DisplaySettings, DisplayShader         pictures as code values of a screen, quickly
    CHANNELS, FALSE_COLORS                              what of a picture is shown; what false colours mean
    view_and_projection                                 what OpenGL draws the picture of a camera with
    require_viewer                                      raises where no window can be shown, with the reason
    choose_pxr, PxrChoice                               the OpenUSD build of this process; before it is imported
    LiveStage        a shot under a look that changes while it is looked at, as a Usd.Stage
    pick, Pick       what a place of a picture shows
    seen_prims, Seen, are_seen                   the same of all pixels; which points nothing hides
    stage_prims, PrimRow                         the tree of a stage
    stage_files, reload_stage                    its files, and how they are read again
    frame_range, FrameRange                      the frames of a shot
    find_next_dab, NextDab                       where one more dab decides
    similarity_to                                what of a picture is like what was painted
    report_of, lines_of_report                   what was inferred and authored, as values and as lines
    review_look, LookReview                      what a look layer changes and what is wrong with it
    UsdslfError      base of all errors that a user can mend, with the exit code of each

Many shots in one run, and one asset in several shots, are `usdslf.batch`, pictures of reviews `usdslf.review`: both
have public names of their own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from usdslf.errors import UsdslfError
from usdslf.first_use import loaded_at_first_use
from usdslf.usd.schema import announce_schema

if TYPE_CHECKING:
    from usdslf.color import Color, color_of
    from usdslf.display import CHANNELS, FALSE_COLORS, DisplayPass, DisplaySettings, DisplayShader
    from usdslf.hints import find_next_dab, similarity_to
    from usdslf.inference.next_dab import NextDab
    from usdslf.look import Look, author
    from usdslf.picking import Pick, Seen, are_seen, pick, seen_prims
    from usdslf.pictures import live_picture, render_shot
    from usdslf.progress import Cancelled, Progress, run, stepwise
    from usdslf.render.live.picture import LiveFrame, LivePicture
    from usdslf.report import lines_of_report, report_of
    from usdslf.scene.cameras import camera_rays, film_aspect, project_points, view_and_projection
    from usdslf.scene.records import Camera, Scene
    from usdslf.session import Session, open
    from usdslf.shot import Shot
    from usdslf.solution import Settings, Solution, solve, stylize_shot
    from usdslf.strokes.paint import paint_stroke
    from usdslf.strokes.remarks import About, Remark
    from usdslf.strokes.stroke import MODES, NORMS, SCOPES, SPACES, TOOLS, Stroke, frame_of, next_name
    from usdslf.usd.live_stage import LiveStage
    from usdslf.usd.prims import FrameRange, PrimRow, frame_range, reload_stage, stage_files, stage_prims
    from usdslf.usd.review.records import LookReview
    from usdslf.usd.review.review import review_look
    from usdslf.usd.stroke_layer import read_strokes, write_strokes
    from usdslf.usd.which_pxr import PxrChoice, choose_pxr
    from usdslf.viewing import require_viewer

__version__ = "0.1.0"

announce_schema()

__all__ = [
    "CHANNELS",
    "FALSE_COLORS",
    "MODES",
    "NORMS",
    "SCOPES",
    "SPACES",
    "TOOLS",
    "About",
    "Camera",
    "Cancelled",
    "Color",
    "DisplayPass",
    "DisplaySettings",
    "DisplayShader",
    "FrameRange",
    "LiveFrame",
    "LivePicture",
    "LiveStage",
    "Look",
    "LookReview",
    "NextDab",
    "Pick",
    "PrimRow",
    "Progress",
    "PxrChoice",
    "Remark",
    "Scene",
    "Seen",
    "Session",
    "Settings",
    "Shot",
    "Solution",
    "Stroke",
    "UsdslfError",
    "__version__",
    "are_seen",
    "author",
    "camera_rays",
    "choose_pxr",
    "color_of",
    "film_aspect",
    "find_next_dab",
    "frame_of",
    "frame_range",
    "lines_of_report",
    "live_picture",
    "next_name",
    "open",
    "paint_stroke",
    "pick",
    "project_points",
    "read_strokes",
    "reload_stage",
    "render_shot",
    "report_of",
    "require_viewer",
    "review_look",
    "run",
    "seen_prims",
    "similarity_to",
    "solve",
    "stage_files",
    "stage_prims",
    "stepwise",
    "stylize_shot",
    "view_and_projection",
    "write_strokes",
]

# Loaded at first use, so that `usdslf --help` and `usdslf doctor` neither wait for USD nor need OpenCL.
if not TYPE_CHECKING:  # type checkers are to find unknown names
    __getattr__, __dir__ = loaded_at_first_use(__name__, {
        "usdslf.scene.records": ("Camera", "Scene"),
        "usdslf.scene.cameras": ("camera_rays", "film_aspect", "project_points", "view_and_projection"),
        "usdslf.color": ("Color", "color_of"),
        "usdslf.display": ("CHANNELS", "DisplayPass", "DisplaySettings", "DisplayShader", "FALSE_COLORS"),
        "usdslf.usd.which_pxr": ("PxrChoice", "choose_pxr"),
        "usdslf.viewing": ("require_viewer",),
        "usdslf.usd.live_stage": ("LiveStage",),
        "usdslf.picking": ("Pick", "Seen", "are_seen", "pick", "seen_prims"),
        "usdslf.usd.prims": ("FrameRange", "PrimRow", "frame_range", "reload_stage", "stage_files", "stage_prims"),
        "usdslf.hints": ("find_next_dab", "similarity_to"),
        "usdslf.inference.next_dab": ("NextDab",),
        "usdslf.report": ("lines_of_report", "report_of"),
        "usdslf.usd.review.records": ("LookReview",),
        "usdslf.usd.review.review": ("review_look",),
        "usdslf.session": ("Session", "open"),
        "usdslf.shot": ("Shot",),
        "usdslf.solution": ("Settings", "Solution", "solve", "stylize_shot"),
        "usdslf.look": ("Look", "author"),
        "usdslf.pictures": ("live_picture", "render_shot"),
        "usdslf.render.live.picture": ("LiveFrame", "LivePicture"),
        "usdslf.progress": ("Cancelled", "Progress", "run", "stepwise"),
        "usdslf.strokes.stroke": ("MODES", "NORMS", "SCOPES", "SPACES", "Stroke", "TOOLS", "frame_of", "next_name"),
        "usdslf.strokes.paint": ("paint_stroke",),
        "usdslf.strokes.remarks": ("About", "Remark"),
        "usdslf.usd.stroke_layer": ("read_strokes", "write_strokes"),
    })  # fmt: skip
