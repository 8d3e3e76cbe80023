"""What USD raises, or cannot spell, is one sentence that names the file and the line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from kit.fuzzed_shot import write_shot
from pxr import Sdf, Usd

from usdslf.errors import InputError, StageError, StrokeError
from usdslf.usd.border import plain, reading, text_of
from usdslf.usd.edited import open_edited
from usdslf.usd.read.read import open_stage, read_scene
from usdslf.usd.stroke_layer import read_strokes

STRAY = b'#usda 1.0\n\ndef Xform "W\xe9rld"\n{\n}\n'


@pytest.mark.parametrize(
    ("read", "kind"),
    [(open_stage, StageError), (read_strokes, StrokeError), (lambda look: open_edited(_good(look), look), InputError)],
)
def test_a_stray_byte_is_one_sentence(read: Callable[[Path], object], kind: type[Exception], tmp_path: Path) -> None:
    path = tmp_path / "stray.usda"
    path.write_bytes(STRAY)
    with pytest.raises(kind) as raised:
        read(path)
    assert str(raised.value).startswith(f"{path} is not a readable USD file, ")
    assert str(raised.value).endswith(": line 3 cannot be understood, at '\\xe9rld\"'")


def _good(beside: Path) -> Path:
    return write_shot(beside.parent)


@pytest.mark.parametrize("data", [STRAY, STRAY.replace(b"\xe9", b"\xff\xfe"), b"#usda 1.0\ndef"])
def test_a_stray_byte_in_a_layer_below_is_a_warning(data: bytes, tmp_path: Path) -> None:
    shot = write_shot(tmp_path)
    (tmp_path / "asset.usda").write_bytes(data)
    scene = read_scene(shot)
    (said,) = [w for w in scene.warnings if "asset.usda" in w]
    assert "cannot be opened: line " in said and "pxrInternal" not in said and said.isprintable()


def test_an_error_of_usd_inside_a_read_is_one_sentence(tmp_path: Path) -> None:
    shot = write_shot(tmp_path)
    shot.write_text(shot.read_text().replace("rel material:binding = </World/mtl/painted>", "token material:binding"))
    with pytest.raises(StageError, match=r"shot.usda is not a readable USD file, .* is not a relationship'?$"):
        read_scene(shot)


def test_bytes_that_are_no_utf8_are_shown() -> None:
    def spell() -> str:
        return b"caf\xe9".decode()

    class Named:
        def __str__(self) -> str:
            return spell()

    assert text_of(Named()) == "caf\\xe9"
    said = r"a.usd is not a readable USD file, export it again: .* near 'caf\\xe9'"
    with pytest.raises(StageError, match=said), reading("a.usd"):
        spell()


def test_any_value_of_usd_is_plain() -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    values = 'mystery b = "x"\ntoken[] c = ["p", "q"]\nmatrix2d d = ((1, 2), (3, 4))'
    layer.ImportFromString(f'#usda 1.0\ndef "a" {{\n{values}\n}}')
    stage = Usd.Stage.Open(layer)
    prim = stage.GetPrimAtPath("/a")
    assert isinstance(layer.GetAttributeAtPath("/a.b").default, Sdf.UnregisteredValue)
    assert "x" in str(plain(layer.GetAttributeAtPath("/a.b").default))
    assert plain(prim.GetAttribute("c").Get()) == ["p", "q"]
    assert plain(prim.GetAttribute("d").Get()) == [1, 2, 3, 4]
