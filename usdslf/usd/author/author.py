"""Edits -> look layer: sparse overrides that win, with where they come from; and the review root.

    author_look(stage, edits, out_path, provenance=None, strokes_path=None, shot_path=None, ...)
        -> list[AuthoredEdit]                                 wins.py: each with what hides and what shows it
    check_look_place(stage, out_path) -> None               before textures are baked for it
    author_review_root(path, look, strokes, shot) -> None     subLayers = [look, strokes, shot]
    why_not_editable(prim) -> str                             "" for what can be edited, else a sentence

`edits` are MaterialChanges (edits.py).  Scope `material` overrides the material in place.  Scopes `prim` and
`stroke` make a new Material that inherits the original, unless the painted prims are all that show it.  A
mode (material_writer.py) says otherwise for all of them.
What each change writes: change_writer.py.  What people added to an earlier look stays: kept.py.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from pxr import Sdf, Usd, UsdShade, Vt

from usdslf.edits.edits import MaterialChange
from usdslf.errors import AuthorError, StageError
from usdslf.replacing import is_file
from usdslf.usd.author.material_writer import MODES
from usdslf.usd.author.writing import Instead, Writing
from usdslf.usd.binding import bound_relationship, named_material, preview_surface, render_contexts
from usdslf.usd.border import reading
from usdslf.usd.files import check_layer_place, relative_path, write_layer
from usdslf.usd.layer.affected import changed_along, final_renders
from usdslf.usd.layer.baked_files import drop_unused
from usdslf.usd.layer.hand_edits import RECORD, added_by_hand, put_under, record_of, what_is_by_hand
from usdslf.usd.layer.look_layer import LookLayer
from usdslf.usd.layer.provenance import layer_data
from usdslf.usd.layer.silent import restore_all
from usdslf.usd.layer.wins import AuthoredEdit, compose_over, with_wins
from usdslf.usd.look_data import is_look
from usdslf.usd.notes import Notes
from usdslf.usd.preview.preview_material import PreviewMaterials, edited_ones, write_made
from usdslf.usd.shot_metadata import ROOT_ONLY, copy_shot_metadata, default_prim_name, shot_files

if TYPE_CHECKING:
    from usdslf.color import Color


class How(TypedDict, total=False):
    """How a look is written."""

    color: Color | None  # its working space is that of the edits; None: taken as the space of the inputs
    mode: str  # "" | override | new | class: which prims take the edits, see material_writer.py
    made: PreviewMaterials | None  # new materials that the edits may be of; those that are edited go into the look
    frame: float  # at which the edits were solved: what is animated is taken as it is there; nan: default time
    instead: Mapping[str, Instead]  # by material: another way than usual, where that does not show
    rivals: Mapping[int, Sequence[MaterialChange]]  # by row of the edits: other explanations, to be its variants
    keeps_textures: bool  # those that the look no longer names are not deleted: this may not be the last try


def author_look(
    stage: Usd.Stage,
    edits: Sequence[MaterialChange],
    out_path: str | os.PathLike[str],
    provenance: Mapping[str, Any] | None = None,
    strokes_path: str | os.PathLike[str] | None = None,
    shot_path: str | os.PathLike[str] | None = None,
    *,
    warnings: list[str] | None = None,
    **how: Unpack[How],
) -> list[AuthoredEdit]:
    """Writes the edits as a look layer, and finds out whether each of them wins.

    A look that is there already loses what usdslf wrote to it before, and keeps what people added.

    Args:
        stage: the shot; neither it nor its files are changed.
        provenance: what goes to customLayerData.usdslf besides shot, strokes and their hashes.
        strokes_path, shot_path: files; recorded relative to the look layer.
        warnings: takes a sentence for each thing that is odd.
        how: the colour, mode, new materials and frame of the edits.

    Raises:
        AuthorError: an edit cannot be written, or the file cannot.
    """
    said = warnings if warnings is not None else []
    out = Path(out_path)
    with reading(f"{shot_path or stage.GetRootLayer().realPath} with {out_path}", AuthorError, "solve into a new file"):
        data = layer_data(stage, out, provenance, strokes_path, shot_path)
        return _author(stage, edits, out, data, said, how)


def _author(
    stage: Usd.Stage, edits: Sequence[MaterialChange], out: Path, data: dict[str, Any], said: list[str], how: How
) -> list[AuthoredEdit]:  # fmt: skip
    mode, made, color = how.get("mode", ""), how.get("made"), how.get("color")
    assert mode in ("", *MODES), mode
    earlier = _earlier_look(stage, out)
    by_hand = added_by_hand(earlier) if earlier else Sdf.Layer.CreateAnonymous(".usda")
    frame = how.get("frame", math.nan)
    time = Usd.TimeCode.Default() if math.isnan(frame) else Usd.TimeCode(frame)
    look = LookLayer(compose_over(stage, made.layer) if made else stage, by_hand, time)
    written: list[AuthoredEdit] = []
    bindings: dict[int, list[tuple[Sdf.Path, Sdf.Path]]] = {}
    for number, change in enumerate(edits):
        instead, rivals = how.get("instead", {}).get(change.material.path), how.get("rivals", {}).get(number, ())
        writing = Writing(look, out.parent, said, color, mode)
        found, bound = writing.write(change, instead) if instead or not rivals else writing.write_all(change, rivals)
        bindings |= dict.fromkeys(range(len(written), len(written) + len(found)), bound)
        written += found
    if made:
        said += _write_made(stage, look, made, out.parent)
    with Sdf.ChangeBlock():
        copy_shot_metadata(stage, look.layer)
        if name := default_prim_name(stage):
            Sdf.CreatePrimInLayer(look.layer, f"/{name}")
            look.layer.defaultPrim = name
        data[RECORD] = Vt.StringArray(record_of(look.layer))
        look.layer.customLayerData = {"usdslf": data}
    layer, lost = put_under(by_hand, look.layer)
    _say_what_is_kept(by_hand, lost, out, said)
    why = f"what was changed by hand in {out.name}"
    mend = f"remove it from {out.name}, then solve again"
    by: dict[str, Any] = {"hidden_by": why, "mend": mend, "is_hidden_by_hand": True}
    written = [replace(e, **by) if _place(e) in lost else e for e in written]
    write_layer(layer, out)
    if earlier and not how.get("keeps_textures", False):
        said += drop_unused(earlier, set(), out)
    for (at, group, chosen), path in look.variants.items():
        said.append(f"{path} is edited in the variant {group}={chosen} of {at} only: other variants stay.")
    review = compose_over(stage, layer)
    written = with_wins(review, layer, written, bindings)
    said += changed_along(review, written) if mode != "class" else []
    said += final_renders(review, dict.fromkeys(p for e in written for p in e.affects))
    return written


def _write_made(stage: Usd.Stage, look: LookLayer, made: PreviewMaterials, folder: Path) -> list[str]:
    """Writes the new materials that were edited, as the shot has none; says which gprims they are for."""
    plain = copy(look)
    plain.stage = stage
    edited, inherited = edited_ones(made, look.layer)
    write_made(plain, made.made, edited, inherited, folder)
    notes = Notes()
    for each in made.made:
        if each.material in edited | inherited:
            notes.add(f"{each.material} is new: a UsdPreviewSurface that shows what {{}} showed", each.prim)
    return notes.sentences()


def _place(edit: AuthoredEdit) -> Sdf.Path:
    return Sdf.Path(edit.prim).AppendProperty(edit.attribute)


def _say_what_is_kept(by_hand: Sdf.Layer, lost: list[Sdf.Path], out: Path, said: list[str]) -> None:
    """Says which opinions of an earlier look are a person's, in a sentence for each kind."""
    notes = Notes()
    for path in what_is_by_hand(by_hand):
        if path in lost:
            notes.add(f"{{}} was changed by hand in {out.name} and stays: what was solved is not seen", path)
        else:
            notes.add(f"{{}} was added by hand to {out.name} and stays", path)
    said += notes.sentences()


def check_look_place(stage: Usd.Stage, out_path: str | os.PathLike[str]) -> None:
    """Raises AuthorError where a look cannot go, before textures are baked for it."""
    check_layer_place(Path(out_path))
    with reading(out_path, AuthorError, "choose another file"):
        _earlier_look(stage, Path(out_path))


def author_review_root(
    path: str | os.PathLike[str],
    look: str | os.PathLike[str],
    strokes: str | os.PathLike[str] | None,
    shot: str | os.PathLike[str],
) -> None:
    """Writes a root layer with subLayers = [look, strokes, shot] that any USD program opens as the shot.

    What only a root layer can say (units, time, expression variables, ...) is copied from the shot.

    Raises:
        StageError: the shot cannot be opened.
        AuthorError: the file is part of the shot, or cannot be written.
    """
    with reading(shot, StageError, "give the stage that was painted"):
        stage = Usd.Stage.Open(str(shot), load=Usd.Stage.LoadNone)
    if Path(path).resolve() in shot_files(stage) | {Path(look).resolve()}:
        raise AuthorError(f"{path} is the shot or the look itself: choose another name for the review root")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    copy_shot_metadata(stage, layer, ROOT_ONLY)
    if name := default_prim_name(stage):
        layer.defaultPrim = name
    folder = Path(path).parent
    layer.subLayerPaths = [relative_path(p, folder) for p in (look, strokes, shot) if p is not None]
    write_layer(layer, path)


def why_not_editable(prim: Usd.Prim) -> str:
    """Says why what a gprim, GeomSubset or Material shows cannot be edited; "" if it can."""
    path = prim.GetPath()
    if prim.IsA(UsdShade.Material):
        material = UsdShade.Material(prim)
    else:
        found = prim.GetStage().GetPrimAtPath(bound_relationship(prim)[0])
        if not found:
            named = named_material(prim)
            return f"{path} has no material." if named.isEmpty else f"{path} is bound to {named}, which is not there."
        material = UsdShade.Material(found)
    if prim.IsInPrototype():
        return f"{path} is in a prototype that USD makes up: edit an instance of it."
    if preview_surface(material):
        return ""
    others = ", ".join(render_contexts(material)) or "no surface"
    return f"{material.GetPath()} has no UsdPreviewSurface (it has {others}): bind a new one to edit {path}."


def _earlier_look(stage: Usd.Stage, out: Path) -> Sdf.Layer | None:
    """Returns the look that is there already, as it was before opinions of it were silenced.

    Raises: AuthorError where something else is there.
    """
    if out.resolve() in shot_files(stage):
        raise AuthorError(f"{out} is part of the shot, which is never written to: choose another file")
    if not is_file(out, AuthorError) or not out.stat().st_size or out.suffix not in (".usda", ".usd", ".usdc"):
        return None
    earlier = Sdf.Layer.OpenAsAnonymous(str(out))  # as it is on disk, whoever wrote it
    if not earlier or not is_look(earlier):
        raise AuthorError(f"{out} exists and is not a look layer of usdslf: choose another file")
    restore_all(earlier)
    return earlier
