"""A file is whole or as it was before: written beside its place, put on the disk, renamed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import AuthorError, InputError
from usdslf.outputs import write_json
from usdslf.replacing import beside, replacing
from usdslf.textures.images import read_image, write_image


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
