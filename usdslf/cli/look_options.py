"""What solve and stylize share: the files of a look layer, and the way from a stage to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from usdslf.cli.program import Settings, gathered
from usdslf.cli.shot_options import Lighting
from usdslf.cli.terminal import progress, say_missing, warn
from usdslf.errors import AuthorError

if TYPE_CHECKING:
    from usdslf.session import Session


@dataclass(frozen=True)
class LookFiles:
    """Where a look goes."""

    output: str  # the look layer
    report: str | None  # JSON
    review_root: str | None  # a root layer over look, strokes and shot

    def check(self) -> None:
        """Raises AuthorError or InputError where one cannot be written; a long run should not find out at its end."""
        from usdslf.outputs import check_place

        for place in filter(None, (self.output, self.review_root)):
            check_place(place, AuthorError)
        if self.report:
            check_place(self.report)


def look_options(report: str, review_root: str) -> Any:
    """Adds -o, --report and --review-root, which arrive as `files`, a `LookFiles`.

    Args:
        report: what the report holds, in words.
        review_root: what the root is laid over, in words.
    """

    def add(command: Any) -> Any:
        command = click.option(
            "--review-root", metavar="REVIEW.usda", help=f"Also write a root over {review_root}."
        )(gathered("files", LookFiles)(command))  # fmt: skip
        command = click.option("--report", metavar="R.json", help=f"Also write {report}, as JSON.")(command)
        return click.option(
            "-o", "output", required=True, metavar="LOOK", help="The look layer to write."
        )(command)  # fmt: skip

    return add


def write_look(
    settings: Settings, stage: str, shot: Lighting, files: LookFiles, find: Callable[[Session], None], **author: Any
) -> None:
    """Opens a shot, finds changes, writes their look and report, and says what was found.

    Args:
        find: lets the session find what it is to author.
        author: more for `Session.author`.
    """
    from usdslf.outputs import write_json
    from usdslf.report import lines_of_report
    from usdslf.usd.author.author import check_look_place

    with progress(settings.quiet) as say:
        session = shot.open(settings, stage, say)
        check_look_place(session.shot.source, files.output)  # before the work, not after it
        say_missing(session.scene)
        find(session)
        session.author(files.output, review_root=files.review_root, **author)
    found = session.report()
    if files.report:
        write_json(files.report, found)
    warn(session.warnings, settings.quiet)
    click.echo("\n".join([*lines_of_report(found), files.output]))
    if session.look and (unseen := session.look.not_shown):
        more = f" (and {len(unseen) - 1} more, see the warnings)" if len(unseen) > 1 else ""
        raise AuthorError(f"{files.output} is written, but the shot does not show all of it: {unseen[0]}{more}")
