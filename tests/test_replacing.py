"""A file is whole or as it was before: written beside its place, put on the disk, renamed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import AuthorError, InputError, StageError, StrokeError
from usdslf.outputs import write_json
from usdslf.replacing import beside, check_place, is_file, is_folder, replacing
from usdslf.textures.images import read_image, write_image
from usdslf.usd.files import check_layer_place
from usdslf.usd.read.read import open_stage
from usdslf.usd.stroke_layer import read_strokes


def test_what_was_there_stays_until_the_block_ends_well(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("earlier")
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError
    assert path.read_text() == "earlier"
    assert os.listdir(tmp_path) == ["a.txt"]
    with replacing(path) as temporary:
        temporary.write_text("later")
    assert path.read_text() == "later"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_content_is_on_the_disk_before_the_name_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    fsync, rename = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda handle: (order.append("fsync"), fsync(handle)))
    monkeypatch.setattr(Path, "replace", lambda self, to: (order.append("rename"), rename(self, to))[1])
    write_json(tmp_path / "a.json", {"a": 1})
    write_image(tmp_path / "a.exr", np.zeros((2, 3, 3), np.float32))
    assert order == ["fsync", "rename"] * 2


def test_a_killed_run_leaves_the_earlier_file(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    write_image(path, np.ones((4, 4, 3), np.float32))
    program = "import sys, time; from usdslf.replacing import replacing\n"
    program += "with replacing(sys.argv[1]) as t: t.write_bytes(b'half'); print('written', flush=True); time.sleep(60)"
    child = subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout and child.stdout.readline() == "written\n"
    child.kill()
    child.communicate()
    assert (read_image(path, "raw", color_of(None, USD_DEFAULT_SPACE))[..., :3] == 1).all()


def test_two_at_once_do_not_share_a_name(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    assert beside(path) != beside(path)
    with replacing(path) as one, replacing(path) as two:
        one.write_text("one")
        two.write_text("two")
    assert path.read_text() == "one"


@pytest.mark.parametrize("path", ["gone/a.json", "folder"])
def test_a_place_that_cannot_be_is_one_sentence_of_the_callers_kind(tmp_path: Path, path: str) -> None:
    (tmp_path / "folder").mkdir()
    for kind in (InputError, AuthorError):
        with pytest.raises(kind, match=f"{path} cannot be written: .+; .+[^.]$"), replacing(tmp_path / path, kind):
            pytest.fail("the block ran")


def test_an_error_of_the_system_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No space left on device; choose another place"), replacing(tmp_path / "a"):
        raise OSError(28, os.strerror(28))


# ── what may not be looked at ────────────────────────────────────────────────────────────────────


@pytest.fixture()
def locked(tmp_path: Path) -> Iterator[Path]:
    """A folder that the user may not look into; the superuser becomes another user for it."""
    folder = tmp_path / "locked"
    folder.mkdir()
    (folder / "file.usda").write_text("#usda 1.0\n")
    folder.chmod(0)
    was = os.geteuid()
    if was == 0:
        os.seteuid(65534)
    try:
        yield folder
    finally:
        os.seteuid(was)
        folder.chmod(0o700)


def test_what_may_not_be_looked_at_is_not_said_to_be_missing(locked: Path) -> None:
    for tells in (is_file, is_folder, check_place):
        with pytest.raises(InputError, match=r"cannot be looked at: permission denied"):
            tells(locked / "file.usda")
    with pytest.raises(AuthorError, match=r"permission denied"):
        check_layer_place(locked / "look.usda")
    with pytest.raises(StageError, match=r"permission denied"):
        open_stage(str(locked / "file.usda"))
    with pytest.raises(StrokeError, match=r"permission denied"):
        read_strokes(locked / "file.usda")


def test_a_name_that_is_too_long_is_a_sentence(tmp_path: Path) -> None:
    long = tmp_path / ("n" * 300 + ".usda")
    for call in (lambda: check_layer_place(long), lambda: check_place(long, AuthorError)):
        with pytest.raises(AuthorError, match=r"cannot be looked at: file name too long"):
            call()
    assert not is_file(tmp_path / "none") and not is_file(tmp_path) and is_folder(tmp_path)
    (tmp_path / "file").write_text("")
    assert is_file(tmp_path / "file") and not is_folder(tmp_path / "file" / "below")
