"""Small shots with strokes in folders of their own, and what can be wrong with one, for batches."""

from __future__ import annotations

import os
from pathlib import Path

from kit.lit_plane import FLOOR, dabs, places, seen, write_plane
from pxr import Usd, UsdGeom

from usdslf.usd.stroke_layer import write_strokes

GOOD = tuple(f"good{k}" for k in range(6))  # the first two are solved, the others shown under a look
WRONG = ("a_hangs", "corrupt", "crashes", "empty", "killed", "missing")
TWELVE = """[[jobs]]
shots = ["shots/a_hangs/stage.usda", "shots/corrupt/stage.usda", "shots/good[2-5]/stage.usda"]
look = "look.usda"
[[jobs]]
shots = ["shots/crashes/stage.usda", "shots/[ekm]*/stage.usda", "shots/good[01]/stage.usda"]
strokes = ["{dir}/strokes.usda"]
"""
OPTIONS = "[options]\nelements = 64\nsize = [48, 27]\nsamples = 1\n"
RED = (0.55, 0.12, 0.1)


def write_shot(folder: Path, diffuse: tuple[float, float, float] = RED) -> Path:
    """A plane under a lamp, `stage.usda`, and strokes that ask for a diffuse colour, `strokes.usda`."""
    folder.mkdir(parents=True, exist_ok=True)
    stage = write_plane(folder)
    at = places()[::2]
    stroke = dabs(at, seen(at, diffuse, FLOOR["specular"], FLOOR["roughness"]))
    write_strokes(folder / "strokes.usda", [stroke], Usd.Stage.Open(str(stage)))
    return stage


def write_manifest(folder: Path, limits: str = "", more: str = "", jobs: str = "") -> Path:
    """A manifest of all `shots/*`, one job a folder; without pictures unless `more` asks for them."""
    pictures = "" if "pictures" in more else "pictures = false\n"
    table = jobs or '[[jobs]]\nshots = ["shots/*/stage.usda"]\nstrokes = ["{dir}/strokes.usda"]\n'
    text = f'output = "out"\nname = "{{folder}}"\n{pictures}{more}[limits]\n{limits}\n{OPTIONS}{table}'
    (folder / "batch.toml").write_text(text)
    return folder / "batch.toml"


def write_twelve(folder: Path, limits: str) -> Path:
    """Twelve shots, six of them with something wrong; `killed` and `crashes` are for who runs them to end.

    Returns: the manifest.
    """
    for name in (*GOOD, *WRONG):
        write_shot(folder / "shots" / name)
    for how in ("corrupt", "empty", "missing"):
        break_shot(folder / "shots" / how, how)
    break_shot(folder / "shots/a_hangs", "hangs")
    write_look(folder / "look.usda")
    return write_manifest(folder, limits, jobs=TWELVE)


def break_shot(folder: Path, how: str) -> None:
    """Makes something wrong with a shot: missing | corrupt | empty | hangs."""
    stage = folder / "stage.usda"
    if how == "missing":
        (folder / "strokes.usda").unlink()
    elif how == "corrupt":
        stage.write_text(stage.read_text().replace('def Plane "floor"', "def Plane floor {{"))
    elif how == "empty":
        stage.unlink()
        empty = Usd.Stage.CreateNew(str(stage))
        UsdGeom.Xform.Define(empty, "/World")
        empty.GetRootLayer().Save()
    elif how == "hangs":  # a layer that never comes
        os.mkfifo(folder / "pipe.usda")
        text = stage.read_text()
        stage.write_text(text.replace("(\n", "(\n    subLayers = [@./pipe.usda@]\n", 1))


def mend_hanging(folder: Path) -> None:
    """Puts a layer in the place of the one that never comes."""
    (folder / "pipe.usda").unlink()
    (folder / "pipe.usda").write_text("#usda 1.0\n")


def bytes_below(folder: Path) -> dict[str, bytes]:
    """The contents of all files below a folder, by their relative paths."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def write_look(path: Path, prim: str = "/World/mtl/floor/surface", diffuse: tuple = (0.5, 0.1, 0.1)) -> Path:
    """A look layer, as solve writes them, that gives a shader a diffuse colour."""
    names = prim.strip("/").split("/")
    inner = f"color3f inputs:diffuseColor = {diffuse}"
    for name in reversed(names):
        inner = f'over "{name}" {{\n{inner}\n}}'
    head = '#usda 1.0\n(\n customLayerData = {\n  dictionary usdslf = {\n   string version = "0"\n  }\n }\n)\n'
    path.write_text(head + inner + "\n")
    return path
