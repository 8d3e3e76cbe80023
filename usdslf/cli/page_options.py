"""The options of what writes a page with pictures: one record for review and diff."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import click

from usdslf.cli.parameters import Size
from usdslf.cli.program import Settings, gathered
from usdslf.cli.shot_options import Lighting

if TYPE_CHECKING:
    from usdslf.review.review import ReviewSettings


@dataclass(frozen=True)
class Pages:
    """What a review shows, and where."""

    output: str | None  # the page
    pictures: str | None  # a folder
    camera: tuple[str, ...]
    size: tuple[int, int]  # pixels
    frames: int
    turntable: int  # views

    @property
    def is_asked(self) -> bool:
        """Whether there is anything to write."""
        return bool(self.output or self.pictures)

    def settings(self, program: Settings, shot: Lighting) -> ReviewSettings:
        """Returns what a review is told."""
        from usdslf.review.review import ReviewSettings

        quality = {k: v for k, v in asdict(shot).items() if k != "frame"}
        return ReviewSettings(
            self.camera, self.size, self.frames, turns=self.turntable, frame=shot.frame, device=program.device,
            ocio=program.ocio, quality=quality,
        )  # fmt: skip


def page_options(command: Any) -> Any:
    """Adds -o, --pictures, --camera, --size, --frames and --turntable, which arrive as `pages`, a `Pages`."""
    frames, turns = click.IntRange(1, 4096), click.IntRange(0, 360)
    for option in (
        click.option("--turntable", type=turns, default=0, metavar="N", help="Also N views round about."),
        click.option("--frames", type=frames, default=8, show_default=True, help="Of each picture, against noise."),
        click.option("--size", type=Size(), default="960x540", show_default=True, help="Of each picture."),
        click.option("--camera", metavar="PRIM", multiple=True, help="Also look from this camera; may be repeated."),
        click.option("--pictures", metavar="DIR", help="Also write the pictures, as EXR and PNG."),
        click.option("-o", "output", metavar="PAGE.html", help="Also write a page with pictures."),
    ):
        command = option(command)
    return gathered("pages", Pages)(command)
