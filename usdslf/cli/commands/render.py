"""usdslf render: a picture of a shot, with or without a look layer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import click

import usdslf
from usdslf.cli.parameters import Similarity, Size
from usdslf.cli.program import Command, Settings, Several, gathered, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.cli.terminal import progress, say_missing, warn
from usdslf.errors import StrokeError

if TYPE_CHECKING:
    from usdslf.scene.records import F32, Camera
    from usdslf.session import Session
    from usdslf.similarity.similarity import Weights
    from usdslf.strokes.stroke import Stroke


def _is_aov(value: str) -> bool:
    from usdslf.outputs import LAYERS

    return value in LAYERS


@dataclass(frozen=True)
class Picture:
    """What is shown, and where the picture goes."""

    output: str
    camera: str | None
    size: tuple[int, int] | None  # pixels
    edits: str | None
    aovs: tuple[str, ...]
    samples: int
    live: int | None  # frames


@dataclass(frozen=True)
class About:
    """The strokes that the layer `similarity` is about."""

    strokes: str | None
    stroke_name: str | None
    similarity: tuple[float, float, float] | None

    def weights(self, aovs: tuple[str, ...]) -> Weights | None:
        """What counts for similarity; raises UsageError where options do not go together."""
        from usdslf.outputs import SIMILARITY
        from usdslf.similarity.similarity import Weights

        is_about_strokes = SIMILARITY in aovs
        if is_about_strokes != bool(self.strokes) or (self.stroke_name and not self.strokes):
            raise click.UsageError(f"--aov {SIMILARITY} and --strokes STROKES go together; give both or none")
        if self.similarity is not None and not is_about_strokes:
            raise click.UsageError(f"--similarity is for --aov {SIMILARITY}; give both or none")
        return Weights(*self.similarity) if self.similarity is not None else None


@click.command(cls=Command)
@click.argument("stage")
@click.option("-o", "output", required=True, metavar="OUT.exr|png", help="EXR: scene-linear. PNG: displayed.")
@click.option("--camera", metavar="PRIM", help="Default: the first one, or one that sees everything.")
@click.option("--size", type=Size(), help="Default: as the camera's film, its longer side 960 pixels.")
@click.option("--edits", metavar="LOOK", help="A look layer to put over the stage.")
@click.option(
    "--aov", "aovs", cls=Several, goes_on=_is_aov, metavar="NAME ...", help="More layers of an EXR, e.g. albedo."
)
@click.option("--strokes", metavar="STROKES", help="The stroke layer that --aov similarity is about.")
@click.option("--stroke", "stroke_name", metavar="NAME", help="Of its strokes, one; default: all that are active.")
@click.option("--similarity", type=Similarity(), help="What counts for --aov similarity; default 1,0.5,2.")
@click.option(
    "--samples",
    type=click.IntRange(1, 4096),
    default=16,
    show_default=True,
    help="Rays a pixel.  The camera's own are 4, from 256 on 16: what is thinner than half a pixel needs these.",
)
@click.option(
    "--live",
    type=click.IntRange(1, 4096),
    metavar="FRAMES",
    help="The picture that a viewer shows after so many frames: 1 comes at once, 64 are about as good as --samples 16.",
)
@lighting_options("Show surfaces without UsdPreviewSurface as solve would edit them.")
@gathered("picture", Picture)
@gathered("about", About)
@settings
def render(settings: Settings, stage: str, shot: Lighting, picture: Picture, about: About) -> None:
    """A picture of direct and indirect light."""
    from usdslf.outputs import SIMILARITY, check_picture, write_picture
    from usdslf.scene.cameras import film_size
    from usdslf.strokes.stroke import frame_of
    from usdslf.usd.edited import open_edited
    from usdslf.usd.review.validate import validate

    output, aovs = picture.output, picture.aovs
    check_picture(output, aovs)
    weights = about.weights(aovs)
    if picture.live and aovs:
        raise click.UsageError("--live has no further layers; leave --aov out, or --live")
    heard: list[str] = []
    chosen = _strokes_of(about.strokes, about.stroke_name, heard) if about.strokes else []
    if chosen:
        shot = replace(shot, frame=frame_of(chosen, shot.frame, heard))
    with progress(settings.quiet) as say:
        session = shot.open(settings, open_edited(stage, picture.edits) if picture.edits else stage, say)
        say_missing(session.scene)
        if picture.edits:
            found = validate(session.stage, settings.ocio)
            heard += [f.message for f in found if f.name in ("DanglingOver", "HiddenEdit")]
        view = session.camera(picture.camera)
        size, similar = picture.size or film_size(view), {}
        if about.strokes:
            similar = {SIMILARITY: session.similarity(chosen, view, size, weights)}
        shown = tuple(a for a in aovs if a != SIMILARITY)
        grey = bool(about.strokes) and output.lower().endswith(".png")
        if picture.live:
            rendered = _live(session, view, size, picture.live)
        else:
            rendered = {} if grey else session.render(view, size, shown, samples=picture.samples)
        pictures = {**rendered, **similar}
    write_picture(output, pictures, session.scene, aovs)
    warn([*heard, *session.warnings], settings.quiet)
    click.echo(output)


def _live(session: Session, view: Camera, size: tuple[int, int], frames: int) -> dict[str, F32]:
    """What a live picture shows after some frames."""
    from usdslf.progress import step, tell, tell_during

    def gather() -> dict[str, F32]:
        for frame in live.frames(frames):
            tell(frame.share)
        return {"color": frame.picture}

    with session.hearing():
        live = usdslf.live_picture(session.shot, view, size=size)
        with step("render", session.own_seconds):
            return tell_during(gather)


def _strokes_of(layer: str, name: str | None, warnings: list[str]) -> list[Stroke]:
    """The active strokes of a layer, or the one of a name."""
    from usdslf.usd.stroke_layer import read_strokes

    strokes = read_strokes(layer, warnings)
    if name is None:
        return [s for s in strokes if s.active]
    found = [s for s in strokes if name in (s.name, s.path)]
    if not found:
        known = ", ".join(s.name for s in strokes) or "none"
        raise StrokeError(f"{layer} has no stroke {name}; it has {known}")
    return found
