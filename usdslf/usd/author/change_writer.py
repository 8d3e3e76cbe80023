"""Writes one solved change into a look layer: the material that it goes to, and the place of each input.

    ChangeWriter(look, change, folder, said, color, mode).write(edit) -> list[AuthoredEdit]
                                                 .write_provenance()

Modes: `override` changes the material where it is, for all that show it (of an instance: this instance);
`new` makes a Material that inherits it, for what was painted only; `class` writes to the class that the
asset inherits, for all its instances; "" is `override` for the scope `material`, else `new` if others show
the material too.
Where to write: network.py for what drives an input, look_layer.py for instances.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import InputEdit, MaterialChange, Reflectance, inferred
from usdslf.errors import AuthorError
from usdslf.scene.records import Texture
from usdslf.textures.images import files_of, why_unreadable
from usdslf.usd.arcs import class_of
from usdslf.usd.binding import bound_relationship, users_of
from usdslf.usd.border import plain
from usdslf.usd.files import relative_path
from usdslf.usd.layer.look_layer import LookLayer, shader_of
from usdslf.usd.layer.network import (
    NEW_TYPES,
    as_attribute,
    driving_prim,
    input_place,
    map_fallback,
    map_primvar,
    map_texture,
    new_node_path,
    path_of_copy,
    same_value,
)
from usdslf.usd.layer.wins import AuthoredEdit

if TYPE_CHECKING:
    from usdslf.color import Color
    from usdslf.edits.baked_texture import Baked

SCOPE = "SlfMaterials"
MODES = ("override", "new", "class")
Names = Sdf.ValueTypeNames


class ChangeWriter:
    """Writes the inputs of one change: finds or makes the material that they go to."""

    def __init__(
        self, look: LookLayer, change: MaterialChange, folder: Path, said: list[str], color: Color | None,
        mode: str = "",
    ) -> None:  # fmt: skip
        self.look, self.change, self.said, self.color = look, change, said, color
        self.folder = folder  # of the look layer: files are named from there
        self.original = Sdf.Path(change.material.path)
        self.shader = shader_of(look.stage, self.original)
        self.bound: list[tuple[Sdf.Path, Sdf.Path]] = []  # prim and the material that it should show
        self.material = self.original
        self.users: list[Usd.Prim] | None = None
        self.mode = mode
        if mode == "class":
            self.look = self._class_view()
        elif mode == "new" or (not mode and change.scope in ("prim", "stroke")):
            self._narrow()

    def _class_view(self) -> LookLayer:
        """The look layer, written to by the class that the material's asset inherits."""
        found = class_of(self.look.stage.GetPrimAtPath(self.original))
        if found is None:
            say = f"{self.original} and what is above it inherit no class"
            raise AuthorError(f"{say}: solve with --mode override or --mode new")
        return self.look.in_class(*found)

    # ---- the material ----------------------------------------------------------------------
    def _narrow(self) -> None:
        """Makes a new Material for the targets, unless they are all that shows the original."""
        stage, faces = self.look.stage, self.change.faces
        targets = self._targets()
        if not targets:
            names = ", ".join(self.change.targets)
            raise AuthorError(f"{names} does not show {self.original}: open the stage that was painted")
        self.users = users_of(stage, self.original)
        whole = not faces or self.change.scope == "prim"
        if whole and self.mode != "new" and {p.GetPath() for p in self.users} <= {p.GetPath() for p in targets}:
            return
        first = targets[0] if not targets[0].IsA(UsdGeom.Subset) else targets[0].GetParent()
        home = self._instance_root(self.original)
        beside = home.GetParentPath()
        scope = beside if beside.name == SCOPE else beside.AppendChild(SCOPE)
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
        bound: set[Sdf.Path] = set()
        for path in paths:
            instance = self._wholly_painted(path, paths)
            if instance is not None:
                if instance not in bound:
                    relationship = bound_relationship(self.look.stage.GetPrimAtPath(path))[1]
                    self.look.bind(instance, relationship, self.material, is_stronger=True)
                    bound.add(instance)
                self.bound.append((path, self.material))
                continue
            relationship = bound_relationship(like or self.look.stage.GetPrimAtPath(path))[1]
            self.look.bind(path, relationship, self.material)
            self.bound.append((path, self.material))

    def _wholly_painted(self, path: Sdf.Path, paths: list[Sdf.Path]) -> Sdf.Path | None:
        """The instance that a gprim is in, if all of it is to show the new material: one binding says so."""
        root = self._instance_root(path) if self.look.stage.GetPrimAtPath(path) else path
        if root == path:
            return None
        below = Usd.PrimRange(self.look.stage.GetPrimAtPath(root), Usd.TraverseInstanceProxies())
        shown = [p for p in below if p.IsA(UsdGeom.Gprim)]
        parts = [s.GetPrim() for p in shown for s in UsdShade.MaterialBindingAPI(p).GetMaterialBindSubsets()]
        return root if {p.GetPath() for p in (*shown, *parts)} <= set(paths) else None

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
            raise AuthorError(f"{self.original} is shaded by {path} outside of it: use the scope `material`")
        return path.ReplacePrefix(self.original, self.material)

    # ---- its inputs ------------------------------------------------------------------------
    def write(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Writes one input; what came of it."""
        if edit.representation == "texture":
            return self._use_baked(edit)
        if edit.representation == "scale":
            return self._map_texture(edit)
        if edit.by_vertex is not None:
            return self._put_vertices(edit)
        if edit.representation == "primvar":
            return self._map_primvar(edit)
        attribute, path, others = input_place(self.shader, edit.input)
        if attribute is not None and UsdShade.Output.IsOutput(attribute):
            why = f"{attribute.GetPath()} drives it, which usdslf cannot change"
            self.said.append(f"{path} stays as it is: {why}.")
            at = str(path.GetPrimPath())
            mend = f"connect {path} to a UsdUVTexture or a UsdPrimvarReader, or to nothing"
            return [AuthoredEdit(at, path.name, edit.before, edit.after, "constant", False, why, str(path), mend)]
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
        spec = self.look.over(shown.GetPrimPath(), path.name)
        self.look.put(spec, path.name, kind, after)
        old, new = plain(before), plain(after)
        return [AuthoredEdit(str(spec.path), path.name, old, new, how, shown_at=str(shown))]

    def _map_texture(self, edit: InputEdit) -> list[AuthoredEdit]:
        opinions, copied = map_texture(self.look.stage, self.shader, edit)
        if not copied.isEmpty:
            self._copy_texture(copied, edit)
        if self._shows_fallback(edit.source):  # which scale and bias do not act on
            path, before, after = map_fallback(self.shader, edit, copied)
            self.said.append(f"{edit.source} shows its fallback, which is edited: its file is not to be read here.")
            return self._put(path, Sdf.ValueTypeNames.Float4, before, after, "constant")
        written = []
        for path, before, after in opinions:
            written += self._put(path, Sdf.ValueTypeNames.Float4, before, after, "scale")
        return written

    def _shows_fallback(self, node: str) -> bool:
        """Whether no file of a texture of the material can be read."""
        inputs = vars(self.change.material).values()
        named = [v for v in inputs if isinstance(v, Texture) and v.prim == node and v.path]
        found = [v for v in inputs if isinstance(v, Texture) and v.prim == node]
        return bool(found) and not any(why_unreadable(file) == "" for v in named for file in files_of(v))

    def _copy_texture(self, copied: Sdf.Path, edit: InputEdit) -> None:
        """Gives an input a texture node of its own: another input reads the channels of the old one."""
        look, texture = self.look, driving_prim(self.shader, edit.input)
        new = look.define(self._moved(copied), "Shader")
        new.specializesList.Prepend(look.place(self._moved(texture.GetPath())))
        output = self.shader.GetInput(edit.input).GetValueProducingAttributes()[0]
        self._connect(self.shader.GetPath(), edit.input, copied, output.GetName(), output.GetTypeName())

    def _connect(
        self, reader: Sdf.Path, name: str, node: Sdf.Path, output: str, kind: Sdf.ValueTypeName
    ) -> None:
        """Connects an input of a shader to a new node; paths are those of the original material."""
        look = self.look
        new = look.over(self._moved(node))
        if output not in new.attributes:
            Sdf.AttributeSpec(new, output, kind, declaresCustom=False)
        there = look.stage.GetAttributeAtPath(reader.AppendProperty(f"inputs:{name}"))
        kind = there.GetTypeName() if there else NEW_TYPES.get(name, kind)
        spec = Sdf.AttributeSpec(
            look.over(self._moved(reader), f"inputs:{name}"), f"inputs:{name}", kind, declaresCustom=False
        )
        spec.connectionPathList.ClearEditsAndMakeExplicit()
        spec.connectionPathList.explicitItems = [look.place(self._moved(node)).AppendProperty(output)]

    # ---- baked textures --------------------------------------------------------------------
    def _use_baked(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Gives the input the texture that was baked: in the node that drives it, or in a new one."""
        baked = edit.baked
        assert baked is not None, edit.input
        if edit.source:
            node = Sdf.Path(str(driving_prim(self.shader, edit.input).GetPath()))
            copied = path_of_copy(self.look.stage, self.shader, edit)
            if not copied.isEmpty:
                self._copy_texture(copied, edit)
        else:
            node = copied = self._new_texture(edit, baked)
        file = Sdf.AssetPath(relative_path(baked.file, self.folder))
        values = {
            "file": (Names.Asset, file),
            "sourceColorSpace": (Names.Token, "raw"),  # of the working space: nothing is to be converted
            "wrapS": (Names.Token, baked.wrap_s),
            "wrapT": (Names.Token, baked.wrap_t),
            "fallback": (Names.Float4, Gf.Vec4f(*baked.fallback)),
        }
        written: list[AuthoredEdit] = []
        for name, (kind, value) in values.items():
            texture = UsdShade.Shader(self.look.stage.GetPrimAtPath(node))
            attribute, path, others = input_place(texture, name) if texture else (None, node, [])
            own = (node if copied.isEmpty else copied).AppendProperty(f"inputs:{name}")
            if others or not copied.isEmpty:
                path = own
            new = self._put(path, kind, attribute.Get() if attribute else None, value, "texture")
            spec = self.look.over(self._moved(path.GetPrimPath()), path.name).attributes[path.name] if new else None
            if spec and path == own and attribute and attribute.GetPath().GetPrimPath() != node:
                spec.connectionPathList.ClearEditsAndMakeExplicit()  # from what others take their value from too
            if spec and name == "file":
                spec.colorSpace = baked.color_space
            written += new
        return written

    def _new_texture(self, edit: InputEdit, baked: Baked) -> Sdf.Path:
        """Makes a UsdUVTexture with a reader of its coordinates, for an input that had none."""
        look = self.look
        node = new_node_path(self.shader, f"slf_{edit.input}")
        reader = new_node_path(self.shader, f"slf_{edit.input}_st")
        for path, kind in ((node, "UsdUVTexture"), (reader, "UsdPrimvarReader_float2")):
            spec = look.define(self._moved(path), "Shader")
            info = Sdf.AttributeSpec(
                spec, "info:id", Names.Token, Sdf.VariabilityUniform, declaresCustom=False
            )
            info.default = kind
        look.put(look.over(self._moved(reader)), "inputs:varname", Names.String, baked.uv_set)
        kind = Names.Float3 if baked.channels == "rgb" else Names.Float
        self._connect(self.shader.GetPath(), edit.input, node, f"outputs:{baked.channels}", kind)
        self._connect(node, "st", reader, "outputs:result", Names.Float2)
        return node

    def _put_vertices(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Gives the points of each gprim a value of their own, and the input a reader of them."""
        assert edit.by_vertex is not None
        look, by = self.look, edit.by_vertex
        users = self.users if self.users is not None else users_of(look.stage, self.original)
        gprims = [p.GetParent() if p.IsA(UsdGeom.Subset) else p for p in users]
        gprims = [p for p in gprims if str(p.GetPath()) in self.change.targets]  # what is hidden shows the fallback
        if any(not p.IsA(UsdGeom.PointBased) for p in gprims):
            self.said.append(f"{self.original} is shown by shapes without points: its mean is written")
            plain_ = dataclasses.replace(edit, representation="constant", by_vertex=None)
            return self.write(plain_)
        name, channels = self._free_primvar(f"slf:{edit.input}", gprims), len(by.after)
        reader = new_node_path(self.shader, f"slf_{edit.input}")
        spec = look.define(self._moved(reader), "Shader")
        info = Sdf.AttributeSpec(spec, "info:id", Names.Token, Sdf.VariabilityUniform, declaresCustom=False)
        info.default = f"UsdPrimvarReader_float{'3' if channels == 3 else ''}"
        look.put(look.over(self._moved(reader)), "inputs:varname", Names.String, name)
        kind = Names.Float3 if channels == 3 else Names.Float
        fallback = Gf.Vec3f(*by.after) if channels == 3 else float(by.after[0])
        look.put(look.over(self._moved(reader)), "inputs:fallback", kind, fallback)
        self._connect(self.shader.GetPath(), edit.input, reader, "outputs:result", kind)
        written = []
        time = Usd.TimeCode.Default() if np.isnan(by.frame) else Usd.TimeCode(by.frame)
        for gprim in dict.fromkeys(gprims):
            world = np.array(UsdGeom.Xformable(gprim).ComputeLocalToWorldTransform(time))
            points = np.asarray(UsdGeom.PointBased(gprim).GetPointsAttr().Get(time), np.float64)
            values = by.at(str(gprim.GetPath()), points @ world[:3, :3] + world[3, :3]).astype(np.float32)
            over = look.over(gprim.GetPath())
            array = Vt.Vec3fArray.FromNumpy(values) if channels == 3 else Vt.FloatArray.FromNumpy(values[:, 0])
            put = look.put(over, f"primvars:{name}", Names.Color3fArray if channels == 3 else Names.FloatArray, array)
            put.SetInfo("interpolation", UsdGeom.Tokens.vertex)
            shown = str(gprim.GetPath().AppendProperty(put.name))
            at = str(put.path.GetPrimPath())
            written.append(AuthoredEdit(at, put.name, edit.before, edit.after, "primvar", shown_at=shown))
        return written

    def _map_primvar(self, edit: InputEdit) -> list[AuthoredEdit]:
        users = self.users if self.users is not None else users_of(self.look.stage, self.original)
        reader, fallback = map_primvar(self.shader, edit)
        gprims = {p.GetParent() if p.IsA(UsdGeom.Subset) else p for p in users}
        found = {g: UsdGeom.PrimvarsAPI(g).FindPrimvarWithInheritance(edit.source) for g in gprims}
        values_of = {g: p.Get() if p and p.HasValue() else None for g, p in found.items()}
        # The fallback is what gprims without the primvar show, and nobody else.
        lacks_it = not users or any(values is None for values in values_of.values())
        name = self._free_primvar(f"slf:{edit.input}", [g for g, values in values_of.items() if values is not None])
        written = self._put(*fallback, "primvar") if lacks_it else []
        path, kind, before = reader
        for gprim, values in values_of.items():
            if values is None:
                continue
            primvar = found[gprim]
            mapped = np.asarray(values) * np.array(edit.scale) + np.array(edit.bias)
            over = self.look.over(gprim.GetPath(), f"primvars:{name}")
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

    def _free_primvar(self, name: str, gprims: Iterable[Usd.Prim]) -> str:
        """A name that gprims have no primvar of yet in the look: other materials may show on parts of them."""
        overs = [self.look.over(g.GetPath()) for g in gprims]
        candidate, number = name, 1
        while any(f"primvars:{candidate}" in over.attributes for over in overs):
            number += 1
            candidate = f"{name}_{number}"
        return candidate

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
