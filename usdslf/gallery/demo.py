"""Demo: runs entries of the gallery into a folder, and writes the index of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdslf.errors import DeviceError, InputError, UsdslfError
from usdslf.gallery import ENTRIES
from usdslf.gallery.page import Page, index_page
from usdslf.gallery.play import Play
from usdslf.gallery.records import Entry
from usdslf.replacing import replacing

if TYPE_CHECKING:
    from usdslf.progress import Say


def chosen_entries(names: Sequence[str], all_names: bool) -> tuple[Entry, ...]:
    """Returns the entries of these names, all of them, or the first one.

    Raises: InputError for an unknown name.
    """
    known = {e.name: e for e in ENTRIES}
    for name in names:
        if name not in known:
            raise InputError(f"there is no demo scene '{name}'; choose from {', '.join(known)}")
    if all_names:
        return ENTRIES
    return tuple(known[n] for n in dict.fromkeys(names)) or ENTRIES[:1]


def run_demos(
    names: Sequence[str], all_names: bool, output: str | Path, hdri: str | None, device: str | None,
    ocio: str | None, say: Say, **options: Any,
) -> Iterator[str]:  # fmt: skip
    """Runs entries into `output`/NAME and writes `output`/index.html; yields what was inferred and shown.

    An entry that fails is said, and the others go on.

    Args:
        options: of `Play`: elements, size, samples, pictures.

    Raises: InputError for an unknown name or a bad hdri; at the end UsdslfError where an entry failed.
    """
    pages: list[Page] = []
    for entry in chosen_entries(names, all_names):
        play, error = None, ""
        folder = Path(output) / entry.name
        yield f"{entry.name}: {folder}"
        try:
            play = Play(entry, folder, hdri, device, ocio, say, **options)
            entry.run(play)
        except (InputError, DeviceError) as bad:
            if play is None:  # nothing that another entry would do better
                raise
            error = str(bad)
        except UsdslfError as bad:
            if len(pages) == 0 and play is None:
                raise
            error = str(bad)
        pages.append(Page(entry, play, error))
        with replacing(Path(output) / "index.html") as temporary:
            temporary.write_text(index_page(pages), encoding="utf-8")
        yield from _lines(pages[-1])
    yield f"pictures: {Path(output) / 'index.html'}"
    failed = [p.entry.name for p in pages if p.error]
    if failed:
        raise UsdslfError(f"{', '.join(failed)} did not run to the end; the index says why")


def _lines(page: Page) -> Iterator[str]:
    if page.play:
        for step in page.play.steps:
            yield f"  {step.title}"
            yield from (f"    {line}" for line in step.lines)
        for s in page.play.shown:
            measured = f" ({s.measured})" if s.measured else ""
            yield f"  {s.sentence}: {'shown' if s.is_true else 'NOT SHOWN'}{measured}"
        last = page.play.steps[-1].folder if page.play.steps else page.play.folder
        if page.play.steps:
            yield f"  {page.play.seconds:.1f} s; open {last / 'review.usda'} in any USD program"
    if page.error:
        yield f"  failed: {page.error}"
