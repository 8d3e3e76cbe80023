"""The command line: one sub-command a step, each a few lines on Session.

The result goes to stdout and the talk to stderr.  Exit codes are those of usdslf/errors.py; an error is one
line, and a traceback only with --debug.
"""

from __future__ import annotations

import json
import math
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import usdslf
from usdslf.cli.parameters import Choose, Color3, Offset, Path2D, Similarity, Size, Weights
from usdslf.cli.terminal import progress, warn
from usdslf.errors import AuthorError, InputError, StrokeError, UsdslfError
from usdslf.strokes.stroke import MODES, NORMS, SCOPES, SPACES, TOOLS
from usdslf.surfaces.reflectance import MODELS

if TYPE_CHECKING:
    from usdslf.session import Say, Session
    from usdslf.strokes.stroke import Stroke


@dataclass
class Settings:
    """What the options hold that every sub-command has."""

    device: str | None = None
    ocio: str | None = None
    quiet: bool = False
    debug: bool = False


def _keep(context: click.Context, option: click.Parameter, value: Any) -> None:
    # Given twice, the later one (after the sub-command) wins; not given, the earlier one stays.
    if value not in (None, False):
        setattr(context.find_root().ensure_object(Settings), str(option.name), value)


def _everywhere() -> list[click.Option]:
    return [
        click.Option(["--device"], metavar="NAME", expose_value=False, callback=_keep,
                     help="OpenCL device: its number or part of its name (see doctor)."),
        click.Option(["--ocio"], metavar="CONFIG", expose_value=False, callback=_keep,
                     help="OpenColorIO config; default $OCIO, else ocio://default."),
        click.Option(["--quiet"], is_flag=True, expose_value=False, callback=_keep,
                     help="No progress and no talk on stderr but errors."),
        click.Option(["--debug"], is_flag=True, expose_value=False, callback=_keep,
                     help="A traceback with an error."),
    ]  # fmt: skip


class Command(click.Command):
    """A sub-command that also takes the options of the program, and `--aov a b` for `--aov a --aov b`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeats an option before each of its values, which have no dot or slash as a stage's name has."""
        several = {o for p in self.params if str(p.metavar or "").endswith("...") for o in p.opts}
        spread: list[str] = []
        option = ""
        for i, arg in enumerate(args):
            if arg.startswith("-"):
                option = arg if arg in several else ""
            elif option and args[i - 1] != option and arg.isidentifier():
                spread.append(option)
            else:
                option = option if i and args[i - 1] == option else ""
            spread.append(arg)
        return super().parse_args(ctx, spread)


class Program(click.Group):
    """The program: its options may stand before or after the sub-command."""

    command_class = Command

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())


settings = click.make_pass_decorator(Settings, ensure=True)


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(usdslf.__version__, prog_name="usdslf")
def program() -> None:
    """Paint how a surface should look; get the material change that explains it, as a USD layer."""


def _frame_options(command: Any) -> Any:
    """Adds --frame and --refine, which every sub-command has that reads a stage."""
    command = click.option(
        "--refine", type=click.IntRange(0, 4), default=1, help="Levels of subdivision of cages; default 1."
    )(command)
    return click.option(
        "--frame", type=float, metavar="F", callback=_finite, help="Time code; default: the stage's start."
    )(command)


def _model_option(command: Any) -> Any:
    """Adds --model."""
    return click.option(
        "--model", type=click.Choice(MODELS), default=MODELS[0], show_default=True,
        help="How surfaces reflect: as UsdPreviewSurface, or the Phong of the paper, to be compared with it.",
    )(command)  # fmt: skip


def _finite(context: click.Context, option: click.Parameter, value: float | None) -> float | None:
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is no finite number", context, option)
    return value


def _open(options: Settings, stage: Any, frame: float | None, say: Say | None, **more: Any) -> Session:
    return usdslf.open(stage, frame=frame, device=options.device, ocio=options.ocio, say=say, **more)


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


def _print_json(values: Any) -> None:
    click.echo(json.dumps(values, indent=2, allow_nan=False))


@program.command()
@click.argument("stage")
@_frame_options
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@settings
def info(options: Settings, stage: str, frame: float | None, refine: int, as_json: bool) -> None:
    """What a stage holds: meshes, materials, lights, cameras, warnings."""
    from usdslf.cli.info import as_text, describe
    from usdslf.usd.review.validate import lines_of_findings, validate

    with progress(options.quiet) as say:
        session = _open(options, stage, frame, say, refine=refine)
    findings = validate(session.stage, session.scene)
    found = describe(session.scene) | {"findings": [vars(f) for f in findings]}
    if as_json:
        _print_json(found)
    else:
        click.echo("\n".join([*as_text(found), *lines_of_findings(findings)]))


@program.command()
@click.argument("stage")
@click.argument("look")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@settings
@click.pass_context
def review(context: click.Context, options: Settings, stage: str, look: str, as_json: bool) -> None:
    """What a look layer changes in a shot, and what is wrong with it; exit code 1 where something is."""
    from usdslf.usd.review.review import lines_of_review, review_look

    found = review_look(stage, look)
    if as_json:
        _print_json(found)
    else:
        click.echo("\n".join(lines_of_review(found)))
    if found["findings"]:
        context.exit(1)


@program.command()
@click.argument("stage")
@click.option("-o", "output", required=True, metavar="OUT.exr|png", help="EXR: scene-linear. PNG: displayed.")
@click.option("--camera", metavar="PRIM", help="Default: the first one, or one that sees everything.")
@click.option("--size", type=Size(), help="Default: as the camera's film, its longer side 960 pixels.")
@click.option("--edits", metavar="LOOK", help="A look layer to put over the stage.")
@click.option("--aov", "aovs", multiple=True, metavar="NAME ...", help="More layers of an EXR, e.g. albedo.")
@click.option("--strokes", metavar="STROKES", help="The stroke layer that --aov similarity is about.")
@click.option("--stroke", "stroke_name", metavar="NAME", help="Of its strokes, one; default: all that are active.")
@click.option("--similarity", type=Similarity(), help="What counts for --aov similarity; default 1,0.5,2.")
@click.option("--samples", type=click.IntRange(1, 4096), default=16, show_default=True, help="Rays a pixel.")
@click.option("--elements", type=int, default=10000, show_default=True, help="Surface elements.")
@click.option("--bounces", type=int, default=8, show_default=True, help="Most bounces of light.")
@click.option("--make-preview", is_flag=True, help="Show surfaces without UsdPreviewSurface as solve would edit them.")
@_model_option
@_frame_options
@settings
def render(
    options: Settings, stage: str, output: str, camera: str | None, size: tuple[int, int] | None, edits: str | None,
    aovs: tuple[str, ...], strokes: str | None, stroke_name: str | None,
    similarity: tuple[float, float, float] | None, samples: int,
    elements: int, bounces: int, make_preview: bool, model: str, frame: float | None, refine: int,
) -> None:  # fmt: skip
    """A picture of direct and indirect light."""
    from usdslf.outputs import SIMILARITY, check_picture, write_picture
    from usdslf.scene.cameras import film_size
    from usdslf.similarity import similarity as propagate
    from usdslf.usd.edited import open_edited

    check_picture(output, aovs)
    is_about_strokes = SIMILARITY in aovs
    if is_about_strokes != bool(strokes) or (stroke_name and not strokes):
        raise click.UsageError(f"--aov {SIMILARITY} and --strokes STROKES go together; give both or none")
    if similarity is not None and not is_about_strokes:
        raise click.UsageError(f"--similarity is for --aov {SIMILARITY}; give both or none")
    weights = propagate.Weights(*similarity) if similarity is not None else None
    with progress(options.quiet) as say:
        shot = open_edited(stage, edits) if edits else stage
        session = _open(
            options, shot, frame, say, refine=refine, elements=elements, bounces=bounces, model=model,
            make_preview=make_preview,
        )  # fmt: skip
        view = session.camera(camera)
        size, similar = size or film_size(view), {}
        if strokes:
            chosen = _strokes_of(strokes, stroke_name, session.warnings)
            similar = {SIMILARITY: session.similarity(chosen, view, size, weights)}
        shown = tuple(a for a in aovs if a != SIMILARITY)
        grey = bool(strokes) and output.lower().endswith(".png")
        pictures = {**({} if grey else session.render(view, size, shown, samples=samples)), **similar}
    write_picture(output, pictures, session.scene, aovs)
    warn(session.warnings, options.quiet)
    click.echo(output)


@program.command()
@click.argument("stage")
@click.argument("strokes")
@click.option("--camera", metavar="PRIM", help="What the stroke is painted on the picture of; default as for render.")
@click.option("--path", "paths", multiple=True, required=True, type=Path2D(),
              help="0..1 of the picture from its top left; again for a lifted pen; one point is a dab.")
@click.option("--radius", type=float, default=0.01, show_default=True, help="Brush, in picture heights.")
@click.option("--color", type=Color3(),
              help="Scene-linear in the working space, unless --color-space.  Only replace needs it, or --image.")
@click.option("--image", metavar="FILE", help="Picture of the camera that points take their colours from.")
@click.option("--color-space", metavar="NAME", help="OpenColorIO space of --color or --image, or: display.")
@click.option("--space", type=click.Choice(SPACES), default="scene", show_default=True,
              help="What the colour means: radiance as seen, or an albedo.")
@click.option("--tool", type=click.Choice(TOOLS), default="replace", show_default=True)
@click.option("--mode", type=click.Choice(MODES), default="direct", show_default=True)
@click.option("--strength", type=float, default=1.0, show_default=True, help="0..1; 0 asks for nothing.")
@click.option("--clone-offset", type=Offset(), help="From the stroke to what clone copies: X,Y on the picture, in "
              "0..1 to the right and down, from where the path starts; or X,Y,Z in the world.")
@click.option("--norm", type=click.Choice(NORMS), default="mixed", show_default=True)
@click.option("--scope", type=click.Choice(SCOPES), default="material", show_default=True)
@click.option("--size", type=Size(), help="Of the picture that was painted on, where it is not as the film.")
@_frame_options
@settings
def stroke(
    options: Settings, stage: str, strokes: str, camera: str | None, paths: tuple[list[list[float]], ...],
    radius: float, color: list[float] | None, image: str | None, color_space: str | None,
    size: tuple[int, int] | None, clone_offset: list[float] | None, frame: float | None, refine: int, **brush: Any,
) -> None:  # fmt: skip
    """Paint a stroke into a stroke layer; prints the path of its prim."""
    from usdslf.strokes.colors import paint_color, paint_image
    from usdslf.usd.stroke_layer import read_strokes, write_strokes

    given = (color is not None) + (image is not None)
    if given > 1 or (not given and brush["tool"] == "replace"):
        raise click.UsageError("give one of --color and --image")
    if (brush["tool"] == "clone") != (clone_offset is not None):
        raise click.UsageError("--tool clone and --clone-offset go together; give both or none")
    session = _open(options, stage, frame, None, refine=refine)
    heard: list[str] = []
    earlier = read_strokes(strokes, heard) if Path(strokes).exists() else []
    one = paint_color(color, color_space, session.scene, heard) if color else np.ones(3, np.float32)
    many = paint_image(image, color_space, session.scene, heard) if image else None
    numbers = [int(s.name[7:]) for s in earlier if s.name.startswith("stroke_") and s.name[7:].isdigit()]
    seen_by, aspect = session.camera(camera), size[0] / size[1] if size else None
    if clone_offset is not None:
        from usdslf.inference.tools import offset_on_picture

        if len(clone_offset) == 2:
            if aspect is None and many is not None:
                aspect = many.shape[1] / many.shape[0]
            clone_offset = offset_on_picture(session.scene, session.tracer, seen_by, paths, clone_offset, aspect)
        brush["clone_offset"] = tuple(clone_offset)
    made = usdslf.paint_stroke(
        session.scene, session.tracer, seen_by, paths, radius, one, many, aspect=aspect,
        name=f"stroke_{max(numbers, default=0) + 1:04d}", **brush,
    )  # fmt: skip
    write_strokes(strokes, [*earlier, made], session.stage)
    warn([*session.warnings, *heard], options.quiet)
    click.echo(made.path)


@program.command()
@click.argument("stage")
@click.argument("strokes")
@click.option("-o", "output", required=True, metavar="LOOK", help="The look layer to write.")
@click.option("--report", metavar="R.json", help="Also write what was inferred, with alternatives, as JSON.")
@click.option("--review-root", metavar="REVIEW.usda", help="Also write a root over look, strokes and shot.")
@click.option("--elements", type=int, default=10000, show_default=True, help="Surface elements.")
@click.option("--directions", type=int, default=1024, show_default=True, help="Of each element; 1024.")
@click.option("--bounces", type=int, default=8, show_default=True, help="Most bounces of light.")
@click.option("--norm", type=click.Choice(NORMS), help="For all strokes; default: each stroke's own.")
@click.option("--weights", type=Weights(), help="Of the norm mixed: three factors of the misfit for one, two and three "
              "freed parameters, 1,5,25 in the paper; or costs by name, e.g. group=8,freedom=2.")
@click.option("--similarity", type=Similarity(), help="What counts where a stroke of scope similar finds more "
              "materials like the painted one; default 0.25,0.25,2.")
@click.option("--choose", type=Choose(), multiple=True, help="Take an alternative of the report.")
@click.option("--mode", type=click.Choice(("override", "new", "class")), default=None,
              help="override: all that show the material; new: a material for what was painted only; class: all "
              "instances, by their asset's class.  Default: as each stroke's scope says.")
@click.option("--make-preview", is_flag=True, help="Give surfaces without UsdPreviewSurface one, to edit them.")
@_model_option
@_frame_options
@settings
def solve(
    options: Settings, stage: str, strokes: str, output: str, report: str | None, review_root: str | None,
    elements: int, directions: int, bounces: int, norm: str | None, choose: tuple[tuple[str, str], ...],
    weights: Any, similarity: tuple[float, float, float] | None,
    mode: str | None, make_preview: bool, model: str, frame: float | None, refine: int,
) -> None:  # fmt: skip
    """Find the smallest material change that explains the strokes, and write it as a look layer."""
    from usdslf.inference.weights import Options
    from usdslf.outputs import check_place, write_json
    from usdslf.report import lines_of_report
    from usdslf.similarity import similarity as propagate
    from usdslf.usd.stroke_layer import read_strokes

    if directions != 1024:
        raise click.UsageError(f"--directions {directions} is not possible; the kernels have 1024")
    weighed = Options.of(weights) if weights is not None else None
    alike = propagate.Weights(*similarity) if similarity is not None else None
    for place in filter(None, (output, review_root)):
        check_place(place, AuthorError)
    if report:
        check_place(report)
    with progress(options.quiet) as say:
        session = _open(
            options, stage, frame, say, refine=refine, elements=elements, bounces=bounces, model=model,
            make_preview=make_preview,
        )  # fmt: skip
        for each in read_strokes(strokes, session.warnings):
            session.add_stroke(each)
        session.solve(norm, dict(choose), weighed, alike)
        session.author(output, strokes_path=strokes, review_root=review_root, mode=mode or "")
    found = session.report()
    if report:
        write_json(report, found)
    warn(session.warnings, options.quiet)
    click.echo("\n".join([*lines_of_report(found), output]))


@program.command()
@click.argument("stage")
@click.option("-o", "output", required=True, metavar="LOOK", help="The look layer to write.")
@click.option("--amount", type=float, default=1.0, show_default=True, metavar="A",
              help="Contrast to add, as a multiple of what is there; 0 changes nothing.")
@click.option("--radius", type=float, default=0.1, show_default=True, metavar="R",
              help="How far the surroundings reach that a place is set off from, as a share of the scene's diagonal.")
@click.option("--norm", type=click.Choice(NORMS), default="mixed", show_default=True,
              help="How freely diffuse, specular and glossiness of a place change together.")
@click.option("--report", metavar="R.json", help="Also write what became of each material, as JSON.")
@click.option("--review-root", metavar="REVIEW.usda", help="Also write a root over look and shot.")
@click.option("--elements", type=int, default=10000, show_default=True, help="Surface elements.")
@click.option("--bounces", type=int, default=8, show_default=True, help="Most bounces of light.")
@click.option("--make-preview", is_flag=True, help="Give surfaces without UsdPreviewSurface one, to edit them.")
@_model_option
@_frame_options
@settings
def stylize(
    options: Settings, stage: str, output: str, amount: float, radius: float, norm: str, report: str | None,
    review_root: str | None, elements: int, bounces: int, make_preview: bool, model: str, frame: float | None,
    refine: int,
) -> None:  # fmt: skip
    """Sharpen the look of the whole shot: unsharp masking of its light, as valid materials."""
    from usdslf.outputs import check_place, write_json
    from usdslf.report import lines_of_report
    from usdslf.stylize.unsharp_mask import check_numbers

    check_numbers(amount, radius)
    for place in filter(None, (output, review_root)):
        check_place(place, AuthorError)
    if report:
        check_place(report)
    with progress(options.quiet) as say:
        session = _open(
            options, stage, frame, say, refine=refine, elements=elements, bounces=bounces, model=model,
            make_preview=make_preview,
        )  # fmt: skip
        session.stylize(amount, radius, norm)
        session.author(output, review_root=review_root)
    found = session.report()
    if report:
        write_json(report, found)
    warn(session.warnings, options.quiet)
    click.echo("\n".join([*lines_of_report(found), output]))


@program.command()
@click.argument("names", nargs=-1, metavar="[NAME ...]")
@click.option("--all", "all_names", is_flag=True, help="Every shipped scene.")
@click.option("-o", "output", default="usdslf-demo", show_default=True, metavar="DIR")
@click.option("--hdri", metavar="FILE", help="Latlong picture for the scenes that are lit by an environment.")
@settings
def demo(options: Settings, names: tuple[str, ...], all_names: bool, output: str, hdri: str | None) -> None:
    """The paper's figures as shipped scenes with scripted strokes: look layers, reports, pictures, an index."""
    from usdslf.gallery.demo import run_demos

    with progress(options.quiet) as say:
        for line in run_demos(names, all_names, output, hdri, options.device, options.ocio, say):
            click.echo(line)


@program.command()
@click.option("--json", "as_json", is_flag=True, help="JSON instead of a table.")
@click.option("--elements", type=int, default=10000, show_default=True, help="Surface elements.")
@settings
def bench(options: Settings, as_json: bool, elements: int) -> None:
    """Time of each step beside the measured limits of this machine."""
    from usdslf.cli.bench import lines_of_table, measure

    with progress(options.quiet) as say:
        found = measure(options.device, options.ocio, elements, say)
    if as_json:
        _print_json(found)
    else:
        click.echo("\n".join(lines_of_table(found)))


@program.command()
@settings
def doctor(options: Settings) -> None:
    """Versions, OpenCL devices, OCIO config, Hydra present or not, limits."""
    from usdslf.cli.doctor import diagnose

    for section, name, value in diagnose(options.device, options.ocio):
        click.echo(f"{section:<13} {name:<26} {value}")


def main(arguments: list[str] | None = None) -> int:
    """Runs the program and returns its exit code."""
    options = Settings()
    try:
        code = program.main(args=arguments, prog_name="usdslf", standalone_mode=False, obj=options)
        return code if isinstance(code, int) else 0
    except click.exceptions.Abort:
        return _say("interrupted", 130)
    except click.ClickException as error:
        return _say(_usage_message(error), InputError.exit_code)
    except KeyboardInterrupt:
        return _say("interrupted", 130)
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        if isinstance(error, UsdslfError):
            return _say(str(error), error.exit_code)
        if isinstance(error, MemoryError):
            return _say("not enough memory; lower --elements or the picture's --size", 4)
        return _say(f"internal error: {type(error).__name__}: {error} (--debug shows where)", 1)


def _usage_message(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    where = f"; see {context.command_path} --help" if context is not None else ""
    return error.format_message().rstrip(".") + where


def _say(message: str, code: int) -> int:
    click.echo("usdslf: " + " ".join(message.split()), err=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
