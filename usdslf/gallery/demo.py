"""Demo: runs entries of the gallery into a folder, and writes the index of them."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdslf.errors import DeviceError, InputError, UsdslfError
from usdslf.gallery import ENTRIES
from usdslf.gallery.environment import check_environment
from usdslf.gallery.page import Page, StepRow, index_page
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

    An entry that fails is said, and the others go on.  Only one entry's sessions are in memory at a time.

    Args:
        options: of `Play`: elements, size, samples, pictures.

    Raises: InputError for an unknown name or a bad hdri; at the end UsdslfError where an entry failed.
    """
    pages: list[Page] = []
    chosen = chosen_entries(names, all_names)
    if hdri:
        check_environment(hdri)
        if not any(e.has_environment for e in chosen):
            lit = ", ".join(e.name for e in ENTRIES if e.has_environment)
            yield f"--hdri {hdri} is not used: of all scenes it lights {lit}"
    options |= {"hdri": hdri, "device": device, "ocio": ocio, "say": say}
    for entry in chosen:
        folder = Path(output) / entry.name
        yield f"{entry.name}: {folder}"
        pages.append(_played(entry, folder, options, is_first=not pages))
        gc.collect()  # the play has gone with all its sessions, before the next one begins
        with replacing(Path(output) / "index.html") as temporary:
            temporary.write_text(index_page(pages), encoding="utf-8")
        yield from _lines(pages[-1])
    yield f"pictures: {Path(output) / 'index.html'}"
    failed = [p.entry.name for p in pages if p.error]
    if failed:
        raise UsdslfError(f"{', '.join(failed)} did not run to the end; the index says why")


def _played(entry: Entry, folder: Path, options: Mapping[str, Any], is_first: bool) -> Page:
    """Runs an entry and returns what the index shows of it; the play and its sessions end here.

    Raises: UsdslfError where the play cannot begin and another entry would do no better.
    """
    play, error = None, ""
    try:
        play = Play(entry, folder, **options)
        entry.run(play)
    except UsdslfError as bad:
        if play is None and (is_first or isinstance(bad, (InputError, DeviceError))):
            raise
        error = str(bad)
    if play is None:
        return Page(entry, error=error)
    steps = tuple(StepRow.of(s) for s in play.steps)
    last = play.steps[-1].folder if play.steps else play.folder
    return Page(entry, True, steps, tuple(play.shown), tuple(play.extras), play.seconds, last, error)


def _lines(page: Page) -> Iterator[str]:
    for step in page.steps:
        yield f"  {step.title}"
        yield from (f"    {line}" for line in step.lines)
    for s in page.shown:
        measured = f" ({s.measured})" if s.measured else ""
        yield f"  {s.sentence}: {'shown' if s.is_true else 'NOT SHOWN'}{measured}"
    if page.steps and page.folder:
        yield f"  {page.seconds:.1f} s; open {page.folder / 'review.usda'} in any USD program"
    if page.error:
        yield f"  failed: {page.error}"
