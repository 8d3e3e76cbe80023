"""The Material that a solved change goes to: where it is, or a new one for what was painted.

    MaterialWriter(look, change, folder, said, color, mode)      .material, .bound, .write_provenance()

Modes: `override` changes the material where it is, for all that show it (of an instance: this instance);
`new` makes a Material that inherits it, for what was painted only; `class` writes to the class that the
asset inherits, for all its instances; "" is `override` for the scope `material`, else `new` if others show
the material too.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import MaterialChange, Reflectance, inferred, moves_of
from usdslf.errors import AuthorError
from usdslf.usd.arcs import class_of
from usdslf.usd.binding import bound_relationship, users_of
from usdslf.usd.layer.affected import read_by_others
from usdslf.usd.layer.look_layer import SCOPE, LookLayer, shader_of
from usdslf.usd.layer.meant import MOVES, moves_data, moves_in
from usdslf.usd.layer.weighed import WEIGHED, weighed_data
from usdslf.usd.look_data import our_data

if TYPE_CHECKING:
    from usdslf.color import Color

MODES = ("override", "new", "class")


class MaterialWriter:
    """Finds or makes the Material that one change goes to."""

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
        self.is_narrow = mode == "new" or (not mode and change.scope in ("prim", "stroke"))
        self._others: set[Sdf.Path] | None = None  # nodes that other materials read
        if mode == "class":
            self.look = self._class_view()
        elif self.is_narrow:
            self._narrow()

    def _class_view(self) -> LookLayer:
        """The look layer, written to by the class that the material's asset inherits."""
        found = class_of(self.look.stage.GetPrimAtPath(self.original))
        if found is None:
            say = f"{self.original} and what is above it inherit no class"
            raise AuthorError(f"{say}: solve with --mode override or --mode new")
        return self.look.in_class(*found)

    def _narrow(self) -> None:
        """Makes a new Material for the targets, unless they are all that shows the original."""
        stage, faces = self.look.stage, self.change.faces
        targets = self._targets()
        if not targets:
            names = ", ".join(self.change.targets)
            raise AuthorError(f"{names} does not show {self.original}: open the stage that was painted")
        self.users = users_of(stage, self.original)
        whole = not faces or self.change.scope == "prim"
        is_own = not self._is_foreign(self.shader.GetPath())
        is_all = {p.GetPath() for p in self.users} <= {p.GetPath() for p in targets}
        if whole and is_own and is_all and self.mode != "new":
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
        for part in showing:
            if part.IsA(UsdGeom.Subset) and self.is_animated(UsdGeom.Subset(part).GetIndicesAttr()):
                self.said.append(f"the faces of {part.GetPath()} are animated; the look layer makes them constant.")
        if not mesh.IsA(UsdGeom.Mesh) or all(self._covers(p, painted) for p in showing):
            if not mesh.IsA(UsdGeom.Mesh):
                self.said.append(f"{mesh.GetPath()} is no mesh with faces: the whole of it changes.")
            self._bind([p.GetPath() for p in showing])
        else:
            self._bind(self.look.subset(mesh, "slf_painted", painted, self.original), like=showing[0])

    def _covers(self, prim: Usd.Prim, painted: np.ndarray) -> bool:
        if prim.IsA(UsdGeom.Subset):
            faces = np.asarray(UsdGeom.Subset(prim).GetIndicesAttr().Get(self.look.time) or [], np.int64)
        else:
            faces = np.arange(len(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get(self.look.time) or []))
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

    def _is_foreign(self, node: Sdf.Path) -> bool:
        """Whether a change of a node would be seen elsewhere than on what was painted, where that is not asked for."""
        if not self.is_narrow:
            return False
        if self.material != self.original:
            return not node.HasPrefix(self.original)
        if self._others is None:
            self._others = read_by_others(self.look.stage, self.original)
        return node in self._others

    @staticmethod
    def is_animated(attribute: Usd.Attribute | None) -> bool:
        if attribute is None or not attribute:
            return False
        return bool(attribute.ValueMightBeTimeVarying() or attribute.GetNumTimeSamples() > 0)

    def write_provenance(self) -> None:
        """Says on the Material which strokes changed it, from what to what, and how well it fits."""
        c = self.change
        data: dict[str, Any] = {
            "material": str(self.material),
            "strokes": Vt.StringArray(list(c.strokes)),
            "before": _reflectance_data(c.before),
            "after": _reflectance_data(c.after),
            "inferred": inferred(c.freed),
        }
        residuals = {"residualBefore": c.residual_before, "residualAfter": c.residual_after}
        data |= {name: float(value) for name, value in residuals.items() if np.isfinite(value)}
        if c.alternatives:
            data[WEIGHED] = weighed_data(c.alternatives)
        over = self.look.over(self.material)
        moves, earlier = moves_of(c), moves_in(our_data(over.customData).get(MOVES))
        data[MOVES] = moves_data(
            earlier | {name: m.joined(earlier[name]) if name in earlier else m for name, m in moves.items()}
        )
        over.SetInfo("customData", {"usdslf": data})


def _reflectance_data(r: Reflectance) -> dict[str, Any]:
    diffuse, specular = (Gf.Vec3f(*(float(x) for x in v)) for v in (r.diffuse, r.f0))
    return {"diffuse": diffuse, "specular": specular, "roughness": float(r.roughness)}
