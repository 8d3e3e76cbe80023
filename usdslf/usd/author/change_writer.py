"""Writes one solved change into a look layer: the place of each of its inputs, and what is written there.

    ChangeWriter(look, change, folder, said, color, mode).write(edit) -> list[AuthoredEdit]
                                                 .write_provenance()

Which material: material_writer.py.  Where to write: network.py for what drives an input, primvar_places.py for
primvars, look_layer.py for instances.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import InputEdit
from usdslf.scene.records import Texture
from usdslf.textures.images import files_of, why_unreadable
from usdslf.usd.author.material_writer import MaterialWriter
from usdslf.usd.binding import users_of
from usdslf.usd.border import plain
from usdslf.usd.files import relative_path
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
from usdslf.usd.layer.primvar_places import primvar_places
from usdslf.usd.layer.wins import AuthoredEdit
from usdslf.usd.read.input_values import holds
from usdslf.usd.read.primvars import as_components

if TYPE_CHECKING:
    from usdslf.edits.baked_texture import Baked

Names = Sdf.ValueTypeNames


class ChangeWriter(MaterialWriter):
    """Writes the inputs of one change."""

    is_constant = False  # whether inputs become constants, cut off from what drives them

    def write(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Writes one input; what came of it."""
        if self.is_constant:
            plain_ = dataclasses.replace(edit, representation="constant", source="", baked=None, by_vertex=None)
            return self._put_constant(plain_)
        if edit.representation == "texture":
            return self._use_baked(edit)
        if edit.representation == "scale":
            return self._map_texture(edit)
        if edit.by_vertex is not None:
            return self._put_vertices(edit)
        if edit.representation == "primvar":
            return self._map_primvar(edit)
        return self._put_constant(edit)

    def _put_constant(self, edit: InputEdit) -> list[AuthoredEdit]:
        """Writes one value, where the input takes its value from if that is one."""
        attribute, path, others = input_place(self.shader, edit.input)
        own = self.shader.GetPath().AppendProperty(f"inputs:{edit.input}")
        is_cut = path != own and (self.is_constant or self._is_foreign(path.GetPrimPath()))
        computed = attribute if attribute is not None and UsdShade.Output.IsOutput(attribute) else None
        if computed is not None and self.is_constant:
            self.said.append(f"{own} is cut off from {computed.GetPath()} and becomes a constant.")
            attribute, path, is_cut = self.look.stage.GetAttributeAtPath(own), own, True
        elif computed is not None:
            why = f"{computed.GetPath()} drives it, which usdslf cannot change"
            self.said.append(f"{path} stays as it is: {why}.")
            at = str(path.GetPrimPath())
            mend = f"connect {path} to a UsdUVTexture or a UsdPrimvarReader, or to nothing"
            return [AuthoredEdit(at, path.name, edit.before, edit.after, "constant", False, why, str(path), mend)]
        elif path == own and attribute is not None and attribute.GetConnections():
            self.said.append(f"{own} is cut off from {attribute.GetConnections()[0]}, which leads nowhere.")
            is_cut = True
        if others and not is_cut:
            self.said.append(f"{path} also drives {', '.join(others)}, which change with it.")
        kind = attribute.GetTypeName() if attribute is not None else NEW_TYPES[edit.input]
        kind = kind if holds(kind, int(np.size(edit.after))) else NEW_TYPES[edit.input]
        after = as_attribute(edit.after, kind, attribute, self.color)
        before = attribute.Get(self.look.time) if attribute is not None and computed is None else None
        before = as_attribute(edit.before, kind, None, None) if before is None else before
        written = self._put(own if is_cut else path, kind, before, after, "constant")
        if written and is_cut:  # others show what it takes its value from
            shown = self._moved(own)
            spec = self.look.over(shown.GetPrimPath(), shown.name).attributes[shown.name]
            spec.connectionPathList.ClearEditsAndMakeExplicit()
        return written

    def _put(
        self, path: Sdf.Path, kind: Sdf.ValueTypeName, before: Any, after: Any, how: str
    ) -> list[AuthoredEdit]:
        """Writes a value of the original material to the one that is edited, unless it is there already."""
        if same_value(before, after):
            return []
        if self.is_animated(self.look.stage.GetAttributeAtPath(path)):
            self.said.append(f"{path} is animated in the shot; the look layer makes it constant.")
        shown = self._moved(path)
        spec = self.look.over(shown.GetPrimPath(), path.name)
        self.look.put(spec, path.name, kind, after)
        old, new = plain(before), plain(after)
        return [AuthoredEdit(str(spec.path), path.name, old, new, how, shown_at=str(shown))]

    def _map_texture(self, edit: InputEdit) -> list[AuthoredEdit]:
        copied = self._path_of_copy(edit)
        opinions = map_texture(self.shader, edit, copied, self.look.time)
        if not copied.isEmpty:
            self._copy_texture(copied, edit)
        if self._shows_fallback(edit.source):  # which scale and bias do not act on
            path, before, after = map_fallback(self.shader, edit, copied, self.look.time)
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

    def _path_of_copy(self, edit: InputEdit) -> Sdf.Path:
        """Where the node that drives an input gets a copy; empty where it can be edited itself."""
        node = driving_prim(self.shader, edit.input).GetPath()
        return path_of_copy(self.look.stage, self.shader, edit, self._is_foreign(node))

    def _copy_texture(self, copied: Sdf.Path, edit: InputEdit) -> None:
        """Gives an input a texture node of its own: another input reads the channels of the old one."""
        look, texture = self.look, driving_prim(self.shader, edit.input)
        new = look.define(self._moved(copied), "Shader")
        path = texture.GetPath()
        new.specializesList.Prepend(look.place(self._moved(path) if path.HasPrefix(self.original) else path))
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
            copied = self._path_of_copy(edit)
            if not copied.isEmpty:
                self._copy_texture(copied, edit)
        else:
            node = copied = self._new_texture_like(edit, baked) if baked.like else self._new_texture(edit, baked)
        file = Sdf.AssetPath(relative_path(baked.file, self.folder))
        values = {
            "file": (Names.Asset, file),
            "sourceColorSpace": (Names.Token, "raw"),  # of the working space: nothing is to be converted
            "wrapS": (Names.Token, baked.wrap_s),
            "wrapT": (Names.Token, baked.wrap_t),
            "fallback": (Names.Float4, Gf.Vec4f(*baked.fallback)),
        }
        if baked.like:  # it holds values as they are
            values |= {"scale": (Names.Float4, Gf.Vec4f(1)), "bias": (Names.Float4, Gf.Vec4f(0))}
        written: list[AuthoredEdit] = []
        for name, (kind, value) in values.items():
            texture = UsdShade.Shader(self.look.stage.GetPrimAtPath(node))
            attribute, path, others = input_place(texture, name) if texture else (None, node, [])
            own = (node if copied.isEmpty else copied).AppendProperty(f"inputs:{name}")
            if others or not copied.isEmpty:
                path = own
            new = self._put(path, kind, attribute.Get(self.look.time) if attribute else None, value, "texture")
            spec = self.look.over(self._moved(path.GetPrimPath()), path.name).attributes[path.name] if new else None
            if spec and path == own and attribute and attribute.GetPath().GetPrimPath() != node:
                spec.connectionPathList.ClearEditsAndMakeExplicit()  # from what others take their value from too
            if spec and baked.like and self._is_connected(f"{baked.like}.{path.name}"):
                spec.connectionPathList.ClearEditsAndMakeExplicit()  # from what the other one takes it from
            if spec and name == "file":
                spec.colorSpace = baked.color_space
            written += new
        return written

    def _is_connected(self, path: str) -> bool:
        attribute = self.look.stage.GetAttributeAtPath(path)
        return bool(attribute) and bool(attribute.HasAuthoredConnections())

    def _new_texture_like(self, edit: InputEdit, baked: Baked) -> Sdf.Path:
        """Makes a UsdUVTexture with the coordinates of another one, for an input that leaves what drove it."""
        look, like = self.look, Sdf.Path(baked.like)
        node = new_node_path(self.shader, f"slf_{edit.input}")
        new = look.define(self._moved(node), "Shader")
        new.specializesList.Prepend(look.place(self._moved(like) if like.HasPrefix(self.original) else like))
        output = f"outputs:{baked.channels}"
        there = look.stage.GetAttributeAtPath(like.AppendProperty(output))  # whose type the new node inherits
        kind = there.GetTypeName() if there else _type_of_output(baked.channels)
        self._connect(self.shader.GetPath(), edit.input, node, output, kind)
        return node

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
        kind = _type_of_output(baked.channels)
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
        look = self.look
        users = self.users if self.users is not None else users_of(look.stage, self.original)
        reader, fallback = map_primvar(self.shader, edit, look.time)
        node = driving_prim(self.shader, edit.input).GetPath()
        if self._is_foreign(node):
            copied = new_node_path(self.shader, f"slf_{node.name}_{edit.input}")
            self._copy_texture(copied, edit)
            reader = (copied.AppendProperty("inputs:varname"), *reader[1:])
            fallback = (copied.AppendProperty("inputs:fallback"), *fallback[1:])
        gprims = dict.fromkeys(p.GetParent() if p.IsA(UsdGeom.Subset) else p for p in users)
        # The fallback is what gprims without the primvar show, and nobody else.
        places, lacks_it = primvar_places(look.stage, gprims, edit.source, look.time)
        name = self._free_primvar(f"slf:{edit.input}", [place.prim for place in places])
        written = self._put(*fallback, "primvar") if lacks_it or not users else []
        path, kind, before = reader
        for place in places:
            primvar = place.primvar
            if self.is_animated(primvar.GetAttr()):
                self.said.append(f"{primvar.GetAttr().GetPath()} is animated; what the look shows of it is constant.")
            size = len(edit.scale)
            mapped = as_components(place.values, size) * np.array(edit.scale) + np.array(edit.bias)
            over = look.over(place.prim.GetPath(), f"primvars:{name}")
            array = Vt.Vec3fArray if size == 3 else Vt.FloatArray
            kept = array.FromNumpy(np.ascontiguousarray(mapped if size == 3 else mapped[:, 0], np.float32))
            own_type = Names.Color3fArray if size == 3 else Names.FloatArray
            spec = look.put(over, f"primvars:{name}", own_type, kept)
            spec.SetInfo("interpolation", primvar.GetInterpolation())
            if indices := primvar.GetIndices(look.time):
                look.put(over, f"primvars:{name}:indices", Sdf.ValueTypeNames.IntArray, indices)
            shown = place.prim.GetPath().AppendProperty(spec.name)
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


def _type_of_output(channels: str) -> Sdf.ValueTypeName:
    """The type of a UsdUVTexture's output of some channels."""
    return Names.Float3 if channels == "rgb" else Names.Float
