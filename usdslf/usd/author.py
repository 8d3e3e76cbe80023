"""Edits -> look layer: sparse overrides that win, with where they come from; and the review root.

    author_look(stage, edits, out_path, provenance=None, strokes_path=None, shot_path=None, ...)
        -> list[AuthoredEdit(prim, attribute, before, after, representation, wins, hidden_by, shown_at)]
    author_review_root(path, look, strokes, shot) -> None     subLayers = [look, strokes, shot]
    why_not_editable(prim) -> str                             "" for what can be edited, else a sentence

`edits` are MaterialChanges (edits.py).  Scope `material` overrides the material in place.  Scopes `prim` and
`stroke` make a new Material that inherits the original, unless the painted prims are all that show it.
Where to write: network.py for what drives an input, look_layer.py for instances.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits import InputEdit, MaterialChange, Reflectance, inferred, material_change_to_input_edits
from usdslf.errors import AuthorError, StageError
from usdslf.usd.files import relative_path, write_layer
from usdslf.usd.look_layer import LookLayer, bound_relationship, preview_surface, shader_of, users_of
from usdslf.usd.network import (
    NEW_TYPES,
    as_attribute,
    driving_prim,
    input_place,
    map_primvar,
    map_texture,
    plain,
    same_value,
)
from usdslf.usd.read import quiet_usd
from usdslf.usd.shot_metadata import ROOT_ONLY, copy_shot_metadata, default_prim_name, shot_files
from usdslf.usd.wins import AuthoredEdit, with_wins

if TYPE_CHECKING:
    from usdslf.color import Color

SCOPE = "SlfMaterials"


def author_look(
    stage: Usd.Stage,
    edits: Sequence[MaterialChange],
    out_path: str | os.PathLike[str],
    provenance: Mapping[str, Any] | None = None,
    strokes_path: str | os.PathLike[str] | None = None,
    shot_path: str | os.PathLike[str] | None = None,
    *,
    warnings: list[str] | None = None,
    color: Color | None = None,
) -> list[AuthoredEdit]:
    """Writes the edits as a look layer, and finds out whether each of them wins.

    Args:
        stage: the shot; neither it nor its files are changed.
        provenance: what goes to customLayerData.usdslf besides shot, strokes and their hashes.
        strokes_path, shot_path: files; recorded relative to the look layer.
        warnings: takes a sentence for each thing that is odd.
        color: its working space is that of the edits; None: taken as the space of the inputs.

    Raises:
        AuthorError: an edit cannot be written, or the file cannot.
    """
    said = warnings if warnings is not None else []
    with quiet_usd():
        return _author(stage, edits, Path(out_path), provenance, strokes_path, shot_path, said, color)


def _author(
    stage: Usd.Stage,
    edits: Sequence[MaterialChange],
    out: Path,
    provenance: Mapping[str, Any] | None,
    strokes_path: str | os.PathLike[str] | None,
    shot_path: str | os.PathLike[str] | None,
    said: list[str],
    color: Color | None,
) -> list[AuthoredEdit]:
    _refuse_to_overwrite(stage, out)
    look = LookLayer(stage)
    written: list[AuthoredEdit] = []
    bindings: dict[int, list[tuple[Sdf.Path, Sdf.Path]]] = {}
    for change in edits:
        inputs = material_change_to_input_edits(change)
        if not inputs:
            continue
        first = len(written)
        writer = _ChangeWriter(look, change, said, color)
        written += [e for edit in inputs for e in writer.write(edit)]
        if len(written) > first:
            writer.write_provenance()
        for i in range(first, len(written)):
            bindings[i] = writer.bound
    with Sdf.ChangeBlock():
        copy_shot_metadata(stage, look.layer)
        if name := default_prim_name(stage):
            Sdf.CreatePrimInLayer(look.layer, f"/{name}")
            look.layer.defaultPrim = name
        data = _layer_data(stage, out, provenance, strokes_path, shot_path)
        look.layer.customLayerData = {"usdslf": data}
    write_layer(look.layer, out)
    return with_wins(stage, look.layer, written, bindings)


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
    try:
        with quiet_usd():
            stage = Usd.Stage.Open(str(shot), load=Usd.Stage.LoadNone)
    except Tf.ErrorException:
        raise StageError(f"The shot {shot} cannot be opened: give the stage that was painted.") from None
    if Path(path).resolve() in shot_files(stage) | {Path(look).resolve()}:
        raise AuthorError(f"{path} is the shot or the look itself: choose another name for the review root.")
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
            named = UsdShade.MaterialBindingAPI(prim).GetDirectBinding().GetMaterialPath()
            return f"{path} is bound to {named}, which is not there." if named else f"{path} has no material."
        material = UsdShade.Material(found)
    if prim.IsInPrototype():
        return f"{path} is in a prototype that USD makes up: edit an instance of it."
    if preview_surface(material):
        return ""
    contexts = [o.GetBaseName().rpartition(":")[0] for o in material.GetSurfaceOutputs()]
    others = ", ".join(c for c in contexts if c) or "no surface"
    return f"{material.GetPath()} has no UsdPreviewSurface (it has {others}): bind a new one to edit {path}."


class _ChangeWriter:
    """Writes the inputs of one change: finds or makes the material that they go to."""

    def __init__(self, look: LookLayer, change: MaterialChange, said: list[str], color: Color | None) -> None:
        self.look, self.change, self.said, self.color = look, change, said, color
        self.original = Sdf.Path(change.material.path)
        self.shader = shader_of(look.stage, self.original)
        self.bound: list[tuple[Sdf.Path, Sdf.Path]] = []  # prim and the material that it should show
        self.material = self.original
        self.users: list[Usd.Prim] | None = None
        if change.scope in ("prim", "stroke"):
            self._narrow()

    # ---- the material ----------------------------------------------------------------------
    def _narrow(self) -> None:
        """Makes a new Material for the targets, unless they are all that shows the original."""
        stage, faces = self.look.stage, self.change.faces
        targets = self._targets()
        if not targets:
            names = ", ".join(self.change.targets)
            raise AuthorError(f"{names} does not show {self.original}: open the stage that was painted.")
        self.users = users_of(stage, self.original)
        whole = not faces or self.change.scope == "prim"
        if whole and {p.GetPath() for p in self.users} <= {p.GetPath() for p in targets}:
            return
        first = targets[0] if not targets[0].IsA(UsdGeom.Subset) else targets[0].GetParent()
        home = self._instance_root(self.original)
        scope = home.GetParentPath().AppendChild(SCOPE)
        name = f"{self.original.name}_{first.GetName()}"
        self.material = self.look.free_path(scope.AppendChild(name))
        if not stage.GetPrimAtPath(scope):
            self.look.define(scope, "Scope")
        self.look.define(self.material, "Material").inheritPathList.Prepend(self.original)
        if whole:
            self._bind([p.GetPath() for p in targets])
        else:
            for mesh in dict.fromkeys(p.GetParent() if p.IsA(UsdGeom.Subset) else p for p in targets):
                self._bind_faces(mesh, [p for p in targets if mesh in (p, p.GetParent())])
        self.users = targets

    def _bind(self, paths: list[Sdf.Path], like: Usd.Prim | None = None) -> None:
        for path in paths:
            relationship = bound_relationship(like or self.look.stage.GetPrimAtPath(path))[1]
            self.look.bind(path, relationship, self.material)
            self.bound.append((path, self.material))

    def _bind_faces(self, mesh: Usd.Prim, showing: list[Usd.Prim]) -> None:
        """Binds the painted faces of a mesh, of what of it shows the original: itself and GeomSubsets."""
        painted = np.unique(self.change.faces.get(str(mesh.GetPath()), ())).astype(np.int64)
        if not mesh.IsA(UsdGeom.Mesh) or all(self._covers(p, painted) for p in showing):
            if not mesh.IsA(UsdGeom.Mesh):
                self.said.append(f"{mesh.GetPath()} is no mesh with faces: the whole of it changes.")
            self._bind([p.GetPath() for p in showing])
        else:
            self._bind(self.look.subset(mesh, "slf_painted", painted, self.original), like=showing[0])

    def _covers(self, prim: Usd.Prim, painted: np.ndarray) -> bool:
        if prim.IsA(UsdGeom.Subset):
            faces = np.asarray(UsdGeom.Subset(prim).GetIndicesAttr().Get() or [], np.int64)
        else:
            faces = np.arange(len(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get() or []))
        return bool(np.isin(faces, painted).all())

    def _targets(self) -> list[Usd.Prim]:
        """The painted gprims and GeomSubsets that show the original; copies of an instancer are one prim."""
        found: dict[Sdf.Path, Usd.Prim] = {}
        for name in self.change.targets:
            prim = self.look.stage.GetPrimAtPath(name.split("[")[0])
            if not prim:
                continue
            subsets = [s.GetPrim() for s in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()]
            shown = [p for p in (prim, *subsets) if bound_relationship(p)[0] == self.original]
            found |= {p.GetPath(): p for p in shown}
        return list(found.values())

    def _instance_root(self, path: Sdf.Path) -> Sdf.Path:
        """The outermost instance that a prim is in, else the prim: new prims go beside it."""
        prim = self.look.stage.GetPrimAtPath(path)
        while prim.IsInstanceProxy():
            prim = prim.GetParent()
        return prim.GetPath()

    def _moved(self, path: Sdf.Path) -> Sdf.Path:
        """A path of the original material in the one that is edited."""
        if self.material == self.original:
            return path
        if not path.HasPrefix(self.original):
            raise AuthorError(f"{self.original} is shaded by {path} outside of it: use the scope `material`.")
        return path.ReplacePrefix(self.original, self.material)

    # ---- its inputs ------------------------------------------------------------------------
    def write(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Writes one input; what came of it."""
        if edit.representation == "scale":
            return self._map_texture(edit)
        if edit.representation == "primvar":
            return self._map_primvar(edit)
        attribute, path, others = input_place(self.shader, edit.input)
        if attribute is not None and UsdShade.Output.IsOutput(attribute):
            why = f"{attribute.GetPath()} drives it, which usdslf cannot change"
            self.said.append(f"{path} stays as it is: {why}.")
            at = str(path.GetPrimPath())
            return [AuthoredEdit(at, path.name, edit.before, edit.after, "constant", False, why, str(path))]
        if others:
            self.said.append(f"{path} also drives {', '.join(others)}, which change with it.")
        if attribute is not None and attribute.ValueMightBeTimeVarying():
            self.said.append(f"{path} is animated in the shot; the look layer makes it constant.")
        kind = attribute.GetTypeName() if attribute is not None else NEW_TYPES[edit.input]
        after = as_attribute(edit.after, kind, attribute, self.color)
        before = attribute.Get() if attribute is not None else None
        before = as_attribute(edit.before, kind, None, None) if before is None else before
        return self._put(path, kind, before, after, "constant")

    def _put(
        self, path: Sdf.Path, kind: Sdf.ValueTypeName, before: Any, after: Any, how: str
    ) -> list[AuthoredEdit]:
        """Writes a value of the original material to the one that is edited, unless it is there already."""
        if same_value(before, after):
            return []
        shown = self._moved(path)
        spec = self.look.over(shown.GetPrimPath())
        self.look.put(spec, path.name, kind, after)
        old, new = plain(before), plain(after)
        return [AuthoredEdit(str(spec.path), path.name, old, new, how, shown_at=str(shown))]

    def _map_texture(self, edit: InputEdit) -> list[AuthoredEdit]:
        opinions, copied = map_texture(self.look.stage, self.shader, edit)
        if not copied.isEmpty:
            self._copy_texture(copied, edit)
        written = []
        for path, before, after in opinions:
            written += self._put(path, Sdf.ValueTypeNames.Float4, before, after, "scale")
        return written

    def _copy_texture(self, copied: Sdf.Path, edit: InputEdit) -> None:
        """Gives an input a texture node of its own: another input reads the channels of the old one."""
        look, texture = self.look, driving_prim(self.shader, edit.input)
        new = look.define(self._moved(copied), "Shader")
        new.specializesList.Prepend(look.place(self._moved(texture.GetPath())))
        port = self.shader.GetInput(edit.input)
        output = port.GetValueProducingAttributes()[0]
        Sdf.AttributeSpec(new, output.GetName(), output.GetTypeName(), declaresCustom=False)
        over, name = look.over(self._moved(self.shader.GetPath())), port.GetFullName()
        spec = Sdf.AttributeSpec(over, name, port.GetTypeName(), declaresCustom=False)
        spec.connectionPathList.ClearEditsAndMakeExplicit()
        target = look.place(self._moved(copied)).AppendProperty(output.GetName())
        spec.connectionPathList.explicitItems = [target]

    def _map_primvar(self, edit: InputEdit) -> list[AuthoredEdit]:
        users = self.users if self.users is not None else users_of(self.look.stage, self.original)
        name = f"slf:{edit.input}"
        reader, fallback = map_primvar(self.shader, edit)
        written = self._put(*fallback, "primvar")
        path, kind, before = reader
        for gprim in {p.GetParent() if p.IsA(UsdGeom.Subset) else p for p in users}:
            primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(edit.source)
            values = primvar.Get() if primvar and primvar.HasValue() else None
            if values is None:
                continue
            mapped = np.asarray(values) * np.array(edit.scale) + np.array(edit.bias)
            over = self.look.over(gprim.GetPath())
            kept = type(values).FromNumpy(mapped.astype(np.float32))
            spec = self.look.put(over, f"primvars:{name}", primvar.GetTypeName(), kept)
            spec.SetInfo("interpolation", primvar.GetInterpolation())
            if indices := primvar.GetIndices():
                self.look.put(over, f"primvars:{name}:indices", Sdf.ValueTypeNames.IntArray, indices)
            shown = gprim.GetPath().AppendProperty(spec.name)
            at, old, new = str(spec.path.GetPrimPath()), plain(edit.before), plain(edit.after)
            written.append(AuthoredEdit(at, spec.name, old, new, "primvar", shown_at=str(shown)))
        if any(e.attribute.startswith("primvars:") for e in written):
            written += self._put(path, kind, before, name, "primvar")
        return written

    def write_provenance(self) -> None:
        """Says on the Material which strokes changed it, from what to what, and how well it fits."""
        c = self.change
        data: dict[str, Any] = {
            "strokes": Vt.StringArray(list(c.strokes)),
            "before": _reflectance_data(c.before),
            "after": _reflectance_data(c.after),
            "inferred": inferred(c.freed),
        }
        residuals = {"residualBefore": c.residual_before, "residualAfter": c.residual_after}
        data |= {name: float(value) for name, value in residuals.items() if np.isfinite(value)}
        self.look.over(self.material).SetInfo("customData", {"usdslf": data})


def _reflectance_data(r: Reflectance) -> dict[str, Any]:
    diffuse, specular = (Gf.Vec3f(*(float(x) for x in v)) for v in (r.diffuse, r.f0))
    return {"diffuse": diffuse, "specular": specular, "roughness": float(r.roughness)}


def _layer_data(
    stage: Usd.Stage,
    out: Path,
    provenance: Mapping[str, Any] | None,
    strokes: str | os.PathLike[str] | None,
    shot: str | os.PathLike[str] | None,
) -> dict[str, Any]:
    """What goes to customLayerData.usdslf: no times, so that the same edit has the same bytes."""
    data = dict(provenance or {})
    stack = [layer.realPath for layer in stage.GetLayerStack(includeSessionLayers=False) if layer.realPath]
    shot = shot or stage.GetRootLayer().realPath
    for name, path, files in (("strokes", strokes, [strokes]), ("shot", shot, stack)):
        if path and Path(path).is_file():
            data.setdefault(name, relative_path(path, out.parent))
            content = b"".join(Path(f).read_bytes() for f in files if f)
            data.setdefault(f"{name}Hash", hashlib.sha256(content).hexdigest())
    return data


def _refuse_to_overwrite(stage: Usd.Stage, out: Path) -> None:
    if out.resolve() in shot_files(stage):
        raise AuthorError(f"{out} is part of the shot, which is never written to: choose another file.")
    if not out.is_file() or not out.stat().st_size or out.suffix not in (".usda", ".usd", ".usdc"):
        return
    try:
        earlier = Sdf.Layer.FindOrOpen(str(out))
    except Tf.ErrorException:
        earlier = None
    if not earlier or "usdslf" not in earlier.customLayerData:
        raise AuthorError(f"{out} exists and is not a look layer of usdslf: choose another file.")
