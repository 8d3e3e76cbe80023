"""What is kept of a shot: byte for byte what is computed, found by what the shot holds and by nothing else."""

from __future__ import annotations

import gc
import logging
import os
import weakref
from collections.abc import Callable
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, TextureInput, write_image

import usdslf
from usdslf import cache, shot, shot_cache, shot_light
from usdslf.elements.lookup import ElementLookup
from usdslf.light_field.light_field import LightField
from usdslf.render.live.sums import Sums
from usdslf.scene.fingerprint import digest

ALL = ["elements", "lookup", "visibility", "light", "field"]


@pytest.fixture(autouse=True)
def used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty cache folder of the user, which is used; OpenCL, which asks for it once, keeps its own."""
    import_module("pyopencl.invoker")
    monkeypatch.setenv("POCL_CACHE_DIR", str(cache.cache_folder().parent / "pocl" / "kcache"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv(cache.SWITCH, "all")


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names what is computed, when it is."""
    found: list[str] = []

    def noted(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            found.append(name)
            return function(*args, **options)

        return call

    homes = (
        (shot, "sample_elements"), (ElementLookup, "_fill"), (shot_light, "trace_visibility"),
        (shot_light, "static_light"), (LightField, "converge"),
    )  # fmt: skip
    for name, (home, function) in zip(ALL, homes, strict=True):
        monkeypatch.setattr(home, function, noted(name, getattr(home, function)))
    return found


def write_stage(folder: Path, grey: float = 0.5, turn: float = 0.0, lamp: float = 3.0, dark: float = 0.1) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    b = StageBuilder(folder)
    write_image(folder / "floor.png", np.full((4, 4, 3), dark, np.float32))
    b.cube("cube", (1, 1, 1), b.material("m", diffuseColor=(grey,) * 3, roughness=0.4), (0, 0.5, 0), turn)
    b.plane("floor", 4, 4, b.material("floor", diffuseColor=TextureInput("floor.png")))
    b.rect_light("lamp", (0.5, 3, 0), (0, 0, 0), 1, 1, (lamp,) * 3)
    return b.save()


def parts_of(path: Path) -> dict[str, np.ndarray]:
    """All that a start computes, of a shot that is opened afresh."""
    s = usdslf.open(str(path), elements=50).shot
    return {
        **{f.name: getattr(s.elements, f.name) for f in fields(s.elements)}, **s.lookup.tables,
        "hit": s.visibility.hit, "light": s.fixed_light, "radiance": s.device.download(s.light_field.outgoing_d),
    }  # fmt: skip


def test_a_second_start_computes_nothing_and_has_the_same_bytes(tmp_path: Path, computed: list[str]) -> None:
    path = write_stage(tmp_path / "a")
    with cache.switched("off"):
        plain = parts_of(path)
    assert computed == ALL
    computed.clear()
    cold, warm = parts_of(path), parts_of(path)
    assert computed == ALL
    for name, value in plain.items():
        assert value.dtype == cold[name].dtype == warm[name].dtype
        np.testing.assert_array_equal(cold[name], value)
        np.testing.assert_array_equal(warm[name], value)
    computed.clear()
    with cache.switched("weights"):
        parts_of(path)
    assert computed == ALL


def test_a_copy_elsewhere_is_the_same_shot(tmp_path: Path, computed: list[str]) -> None:
    parts_of(write_stage(tmp_path / "a"))
    computed.clear()
    parts_of(write_stage(tmp_path / "elsewhere" / "b"))
    assert computed == []


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ({"turn": 10.0}, ALL),
        ({"lamp": 4.0}, ["elements", "light", "field"]),
        ({"grey": 0.6}, ["elements", "light", "field"]),
        ({"dark": 0.2}, ["elements", "light", "field"]),
    ],
)
def test_what_a_change_concerns_is_computed_again(
    change: dict[str, float], again: list[str], tmp_path: Path, computed: list[str]
) -> None:
    """A picture that changes under its name and time too; rays go the same way whatever the light is."""
    path = write_stage(tmp_path / "a")
    before = parts_of(path)
    times = {file: file.stat() for file in path.parent.iterdir()}
    write_stage(tmp_path / "b", **change)
    for file, stat in times.items():
        os.replace(tmp_path / "b" / file.name, file)
        if file.suffix == ".png":  # USD itself goes by the times of layers
            os.utime(file, ns=(stat.st_atime_ns, stat.st_mtime_ns + 1))
    computed.clear()
    after = parts_of(path)
    assert computed == again
    assert not np.array_equal(after["radiance"], before["radiance"])
    with cache.switched("off"):
        plain = parts_of(path)
    for name, value in plain.items():
        np.testing.assert_array_equal(after[name], value)


def test_another_program_computes_all_again(
    tmp_path: Path, computed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of which a module or a kernel says something else."""
    path, code = write_stage(tmp_path / "a"), shot_cache.program_code.__wrapped__
    parts_of(path)
    computed.clear()
    monkeypatch.setattr(shot_cache, "program_code", lambda: "another")
    parts_of(path)
    assert computed == ALL
    files = {suffix: tmp_path / f"a{suffix}" for suffix in (".py", ".cl")}
    monkeypatch.setattr(shot_cache, "_files_in", lambda _, suffix: [str(files[suffix])])
    codes = set()
    for module, kernel in (("x = 1", "// 1"), ("x = 2", "// 1"), ("x = 1", "// 2")):
        files[".py"].write_text(module)
        files[".cl"].write_text(kernel)
        codes.add(code())
    assert len(codes) == 3 and code() in codes


def test_a_damaged_entry_is_computed_again_and_said(
    tmp_path: Path, computed: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    path = write_stage(tmp_path / "a")
    before = parts_of(path)
    (file,) = cache.cache_folder().glob("visibility-*")
    file.write_bytes(file.read_bytes()[:-100])
    computed.clear()
    with caplog.at_level(logging.WARNING):
        after = parts_of(path)
    assert computed == ["visibility"]
    assert [r.message for r in caplog.records if "is damaged" in r.message]
    np.testing.assert_array_equal(after["hit"], before["hit"])


def picture_of(shot: usdslf.Shot) -> bytes:
    *_, frame = usdslf.live_picture(shot, size=(32, 18)).frames(2)
    return frame.picture.tobytes()


@pytest.fixture
def summed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Notes when a light field is summed up for pictures."""
    found: list[str] = []
    plain = Sums.of

    def noted(*args: Any) -> Sums:
        found.append("sums")
        return plain(*args)

    monkeypatch.setattr(Sums, "of", staticmethod(noted))
    return found


@pytest.mark.parametrize("damaged", ["", "field", "sums"])
def test_pictures_are_the_same_whatever_is_kept(
    damaged: str, tmp_path: Path, computed: list[str], summed: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    path = write_stage(tmp_path / "a")
    open_ = lambda: usdslf.open(str(path), elements=50).shot  # noqa: E731
    with cache.switched("off"):
        off = picture_of(open_())
    cold = picture_of(open_())
    computed.clear()
    summed.clear()
    for file in cache.cache_folder().glob(f"{damaged}-*" if damaged else "none"):
        content = bytearray(file.read_bytes())
        content[-5] ^= 1
        file.write_bytes(content)
    with caplog.at_level(logging.WARNING):
        warm = picture_of(open_())
    assert off == cold == warm
    assert [r.message for r in caplog.records if "is damaged" in r.message] == [ANY] * bool(damaged)
    assert (computed, summed) == (["field"] * (damaged == "field"), ["sums"] * (damaged == "sums"))


def test_a_first_picture_reads_nothing_of_what_bounces_need(tmp_path: Path, computed: list[str]) -> None:
    """Links and fixed light come when a bounce asks; where they are no more there, they are made."""
    path = write_stage(tmp_path / "a")
    cold = usdslf.open(str(path), elements=50).shot
    first, changes = picture_of(cold), [cold.light_field.bounce() for _ in range(2)]
    for kind in ("light", "visibility"):
        for file in cache.cache_folder().glob(f"{kind}-*"):
            file.unlink()
    computed.clear()
    warm = usdslf.open(str(path), elements=50).shot
    assert picture_of(warm) == first and computed == []
    assert [warm.light_field.bounce() for _ in range(2)] == changes
    assert computed == ["visibility", "light"]
    assert warm.visibility.hit.tobytes() == cold.visibility.hit.tobytes()
    assert computed == ["visibility", "light"]


def test_a_shot_goes_when_nobody_holds_it(tmp_path: Path) -> None:
    """Its light field, which may still ask for links, does not hold it."""
    path = write_stage(tmp_path / "a")
    for _ in range(2):  # cold, then warm
        shot = usdslf.open(str(path), elements=50).shot
        picture_of(shot)
        gone = weakref.ref(shot)
        gc.collect()
        gc.disable()
        try:
            del shot
            assert gone() is None
        finally:
            gc.enable()


def test_a_look_does_not_take_what_is_kept_of_the_shot(tmp_path: Path) -> None:
    path = write_stage(tmp_path / "a")
    parts_of(path)
    look = tmp_path / "look.usda"
    look.write_text(
        '#usda 1.0\nover "World"\n{\nover "mtl"\n{\nover "m"\n{\nover "surface"\n{\n'
        "color3f inputs:diffuseColor = (0.9, 0.1, 0.1)\n}\n}\n}\n}\n"
    )
    found = []
    for switch in ("all", "all", "off"):
        with cache.switched(switch):
            edited = usdslf.open(str(path), elements=50).edited(look).shot
            found.append(edited.device.download(edited.light_field.outgoing_d))
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[1], found[2])


def test_no_cache_reads_and_keeps_nothing(tmp_path: Path, run: Callable[..., tuple[int, str, str]]) -> None:
    path = write_stage(tmp_path / "a")
    command = ("render", path, "-o", tmp_path / "p.exr", "--size", "16x9", "--elements", "60", "--samples", "1")
    assert run(*command, "--no-cache")[0] == 0
    assert not list(cache.cache_folder().glob("*"))
    assert run(*command)[0] == 0
    assert {f.name.split("-")[0] for f in cache.cache_folder().glob("*")} >= set(ALL)


def test_an_unknown_switch_is_a_sentence(
    tmp_path: Path, run: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.SWITCH, "maybe")
    code, _, said = run("render", write_stage(tmp_path / "a"), "-o", tmp_path / "p.exr", "--size", "16x9")
    assert code == 2 and "USDSLF_CACHE=maybe is not known; set all, weights or off" in said


def test_values_that_differ_have_other_names() -> None:
    values = [
        [1, 2], [12], ["1", 2], [[1], 2], [1.0, 2], None, [None], {"a": 1}, {"b": 1}, {"a": [1]}, True, b"x", "x",
        np.zeros(2, np.float32), np.zeros(2), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros(0), np.zeros((0, 3)),
    ]  # fmt: skip
    names = [digest(v, str.encode) for v in values]
    assert len(set(names)) == len(names)
    with pytest.raises(TypeError, match="object has no fingerprint"):
        digest(object(), str.encode)
