"""usdslf stroke: paints a stroke into a stroke layer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

import usdslf
from usdslf.cli.parameters import Color3, Offset, Path2D, Size
from usdslf.cli.program import Command, Settings, gathered, settings
from usdslf.cli.shot_options import Reading, reading_options
from usdslf.cli.terminal import warn
from usdslf.replacing import is_file
from usdslf.strokes.words import MODES, NORMS, SCOPES, SPACES, TOOLS

if TYPE_CHECKING:
    from usdslf.scene.records import Camera
    from usdslf.session import Session


@dataclass(frozen=True)
class Placing:
    """Where on a picture the brush goes."""

    camera: str | None
    paths: tuple[list[list[float]], ...]
    radius: float
    size: tuple[int, int] | None  # of the picture, in pixels


@dataclass(frozen=True)
class Paint:
    """Where the colour comes from."""

    color: list[float] | None
    image: str | None
    color_space: str | None


@dataclass(frozen=True)
class Brush:
    """What the stroke asks for, as `usdslf.paint_stroke` takes it."""

    space: str
    tool: str
    mode: str
    strength: float
    clone_offset: list[float] | None
    norm: str
    scope: str


@click.command(cls=Command)
@click.argument("stage")
@click.argument("strokes")
@click.option("--camera", metavar="PRIM", help="What the stroke is painted on the picture of; default as for render.")
@click.option(
    "--path",
    "paths",
    multiple=True,
    required=True,
    type=Path2D(),
    help="0..1 of the picture from its top left; again for a lifted pen; one point is a dab.",
)
@click.option("--radius", type=float, default=0.01, show_default=True, help="Brush, in picture heights.")
@click.option(
    "--color",
    type=Color3(),
    help="Scene-linear in the working space, unless --color-space.  Only replace needs it, or --image.",
)
@click.option("--image", metavar="FILE", help="Picture of the camera that points take their colours from.")
@click.option("--color-space", metavar="NAME", help="OpenColorIO space of --color or --image, or: display.")
@click.option(
    "--space",
    type=click.Choice(SPACES),
    default="scene",
    show_default=True,
    help="What the colour means: radiance as seen, or an albedo.",
)
@click.option(
    "--tool",
    type=click.Choice(TOOLS),
    default="replace",
    show_default=True,
    help="What the stroke asks for: its colour; what is seen at --clone-offset; more or less light; a softer or "
    "crisper highlight; or, fixate, that all stays as it is.",
)
@click.option(
    "--mode",
    type=click.Choice(MODES),
    default="direct",
    show_default=True,
    help="direct: what is painted changes; indirect: it stays, and what its light comes from changes.",
)
@click.option("--strength", type=float, default=1.0, show_default=True, help="0..1; 0 asks for nothing.")
@click.option(
    "--clone-offset",
    type=Offset(),
    help="From the stroke to what clone copies: X,Y on the picture, in "
    "0..1 to the right and down, from where the path starts; or X,Y,Z in the world.",
)
@click.option(
    "--norm",
    type=click.Choice(NORMS),
    default="mixed",
    show_default=True,
    help="How many of diffuse, specular and glossiness may change: l2 all, l0 one, mixed as few as it takes.",
)
@click.option(
    "--scope",
    type=click.Choice(SCOPES),
    default="material",
    show_default=True,
    help="How far the change may spread: the faces that were painted, the gprim, all that shows the material, or also "
    "materials that are similar.",
)
@click.option("--size", type=Size(), help="Of the picture that was painted on, where it is not as the film.")
@reading_options
@gathered("placing", Placing)
@gathered("paint", Paint)
@gathered("brush", Brush)
@settings
def stroke(
    settings: Settings, stage: str, strokes: str, shot: Reading, placing: Placing, paint: Paint, brush: Brush
) -> None:
    """Paint a stroke into a stroke layer; prints the path of its prim."""
    from usdslf.strokes.colors import paint_color, paint_image
    from usdslf.strokes.stroke import next_name
    from usdslf.usd.stroke_layer import read_strokes, write_strokes

    given = (paint.color is not None) + (paint.image is not None)
    if given > 1 or (not given and brush.tool == "replace"):
        raise click.UsageError("give one of --color and --image")
    if (brush.tool == "clone") != (brush.clone_offset is not None):
        raise click.UsageError("--tool clone and --clone-offset go together; give both or none")
    session = shot.open(settings, stage, None)
    heard: list[str] = []
    earlier = read_strokes(strokes, heard) if is_file(strokes) else []
    space, scene = paint.color_space, session.scene
    one = paint_color(paint.color, space, scene, heard) if paint.color else (1.0, 1.0, 1.0)
    many = paint_image(paint.image, space, scene, heard) if paint.image else None
    camera, aspect = session.camera(placing.camera), placing.size[0] / placing.size[1] if placing.size else None
    if aspect is None and many is not None:
        aspect = many.shape[1] / many.shape[0]
    made = usdslf.paint_stroke(
        scene, session.tracer, camera, placing.paths, placing.radius, one, many, aspect=aspect,
        name=next_name(earlier), **_brush(session, camera, placing, brush, aspect),
    )  # fmt: skip
    write_strokes(strokes, [*earlier, made], session.stage)
    warn([*session.warnings, *heard], settings.quiet)
    click.echo(made.path)


def _brush(session: Session, camera: Camera, placing: Placing, brush: Brush, aspect: float | None) -> dict[str, Any]:
    """The brush as `paint_stroke` takes it: its clone offset in the world."""
    offset, options = brush.clone_offset, dict(vars(brush))
    if offset is not None and len(offset) == 2:
        from usdslf.inference.tools import offset_on_picture

        offset = offset_on_picture(session.scene, session.tracer, camera, placing.paths, offset, aspect)
    return options | {"clone_offset": tuple(offset or (0.0, 0.0, 0.0))}
