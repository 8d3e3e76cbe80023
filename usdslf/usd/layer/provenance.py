"""Where a look comes from: which shot and strokes, and whether they are still what they were.

layer_data(stage, out, given, strokes, shot) -> dict     what goes to customLayerData.usdslf
stale(look) -> list[str]                                  files that changed since, or are gone
of_another_shot(look, stage) -> list[str]                 whether it was solved for another shot
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, Vt

from usdslf.errors import StageError
from usdslf.usd.border import reading
from usdslf.usd.files import relative_path
from usdslf.usd.look_data import our_data


def layer_data(
    stage: Usd.Stage,
    out: Path,
    given: Mapping[str, Any] | None,
    strokes: str | os.PathLike[str] | None,
    shot: str | os.PathLike[str] | None,
) -> dict[str, Any]:
    """Returns what a look says of its origin: no times, so that the same edit has the same bytes."""
    data = {k: Vt.StringArray(v) if isinstance(v, list) else v for k, v in (given or {}).items()}
    shot = shot or stage.GetRootLayer().realPath
    for name, path, files in (("strokes", strokes, [strokes]), ("shot", shot, _stack(stage))):
        if path and os.path.isfile(path):
            data.setdefault(name, relative_path(path, out.parent))
            data.setdefault(f"{name}Hash", _hash(f for f in files if f))
    return data


def stale(look: Sdf.Layer) -> list[str]:
    """Returns a phrase for the shot and for the strokes of a look if they are not what they were."""
    data = {name: str(value) for name, value in our_data(look.customLayerData).items()}
    found = []
    for name in ("shot", "strokes"):
        if not data.get(name) or not data.get(f"{name}Hash"):
            continue
        path = look.ComputeAbsolutePath(data[name])
        if not os.path.isfile(path):
            found.append(f"its {name} {data[name]} is gone")
        elif data[f"{name}Hash"] != _hash(_files(path) if name == "shot" else [path]):
            found.append(f"its {name} {data[name]} changed since")
    return found


def of_another_shot(look: Sdf.Layer, stage: Usd.Stage) -> list[str]:
    """Returns a phrase where a look was solved for a shot that is no part of a stage; that which is gone is `stale`."""
    data = our_data(look.customLayerData)
    shot = str(data.get("shot", ""))
    path = look.ComputeAbsolutePath(shot) if shot else ""
    if not os.path.isfile(path):
        return []
    files = _stack(stage)
    if any(os.path.realpath(path) == os.path.realpath(f) for f in files):
        return []
    own = [f for f in files if os.path.realpath(f) != os.path.realpath(look.realPath)]
    if data.get("shotHash") == _hash(own):  # a copy of it
        return []
    return [f"it was solved for {shot}, which is no part of this shot"]


def _stack(stage: Usd.Stage) -> list[str]:
    """Files of a stage's own layer stack, strongest first."""
    return [x.realPath for x in stage.GetLayerStack(includeSessionLayers=False) if x.realPath]


def _files(shot: str) -> list[str]:
    try:
        with reading(shot):
            return _stack(Usd.Stage.Open(shot, load=Usd.Stage.LoadNone))
    except StageError:
        return [shot]


def _hash(files: Iterable[str | os.PathLike[str]]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(Path(file).read_bytes())
    return digest.hexdigest()
