"""Places: where results may go, and files that are whole or not there.

    check_name(name) -> str                    "" for a name of a folder below the output, else why it is none
    why_outside(output, name) -> str           "" unless a link on the way leads out of the output folder
    staged(output, name) -> context manager of a Path     a folder that becomes the result's, if the block ends well

Two workers that do the same job write the same bytes, and the later one wins; one that is killed leaves a folder whose
name begins with a dot, which the next run removes.
"""

from __future__ import annotations

import os
import re
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from usdslf.errors import AuthorError
from usdslf.progress import undisturbed

RECORDS = ".batch"  # folder of what failed
OWN = ("index.html", "summary.json", "summary.csv", "junit.xml", "sheet.png")  # at the top of the output folder
ABANDONED = 3600.0  # seconds after which a folder that never became a result is nobody's


def check_name(name: str) -> str:
    """Returns why a name is none of a job, in words; "" where it is one."""
    if name.startswith("/") or re.match(r"[A-Za-z]:", name) or "\\" in name:
        return "is an absolute path"
    parts = name.split("/")
    if ".." in parts:
        return "leads out of the output folder"
    for part in parts:
        if not part or part.startswith(".") or not re.fullmatch(r"[\w\-. +@=]+", part) or part.endswith((" ", ".")):
            return "is no name of a folder: use letters, digits and _-.+@="
    return "is a file of the summary" if parts[0] in OWN else ""


def why_outside(output: str | os.PathLike[str], name: str) -> str:
    """Returns why a result may not be written, where a link stands on its way; "" where it may."""
    place = Path(output)
    for part in ("", *name.split("/")):
        place = place / part if part else place
        if place.is_symlink():
            return f"{place} is a link, and nothing is written through links; remove it"
    return ""


@contextmanager
def staged(output: str | os.PathLike[str], name: str) -> Iterator[Path]:
    """Yields a new folder beside that of a result, and puts it in its place when the block ends without error.

    Raises: AuthorError where a link leads out of the output folder, or it cannot be written.
    """
    target = Path(output, *name.split("/"))
    if why := why_outside(output, name):
        raise AuthorError(why)
    unique = uuid.uuid4().hex[:12]
    made, earlier = (target.parent / f".{target.name}.{unique}.{end}" for end in ("new", "old"))
    try:
        try:
            made.mkdir(parents=True)
        except OSError as failed:
            reason = str(failed.strerror or failed).lower()
            raise AuthorError(f"{target} cannot be written: {reason}; choose another output folder") from None
        yield made
        with undisturbed():
            if why := why_outside(output, name):
                raise AuthorError(why)
            if target.exists():
                target.rename(earlier)
            made.rename(target)
    finally:
        for folder in (made, earlier):
            shutil.rmtree(folder, ignore_errors=True)


def remove_abandoned(output: str | os.PathLike[str]) -> None:
    """Removes what killed runs left unfinished, once it is an hour old."""
    old = time.time() - ABANDONED
    for folder in Path(output).rglob(".*.new") if Path(output).is_dir() else ():
        if re.fullmatch(r"\..+\.[0-9a-f]{12}\.new", folder.name) and folder.stat().st_mtime < old:
            shutil.rmtree(folder, ignore_errors=True)
