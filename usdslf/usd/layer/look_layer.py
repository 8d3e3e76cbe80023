"""A look layer while it is written: opinions put where they win, also for what lies inside instances.

    LookLayer(stage).place(path) -> Sdf.Path        where an opinion about a composed prim has to be written
                    .over(path, name) -> PrimSpec   the `over` there
                    .put(prim, name, type, value)   an attribute opinion
                    .bind(prim, material)           a binding that replaces the one that shows
                    .subset(gprim, name, faces)     faces as a GeomSubset for a binding
                    .in_class(prim, class)          the same layer, written to by the class of an asset

USD discards overs below an instance.  So an opinion about a prim inside an instance goes to a class at the
root of the layer that the instance inherits: this instance changes and no other.  Instances inside
instances get a class each.  What a variant holds is overridden inside this variant: the others stay.
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdShade, Vt

from usdslf.errors import AuthorError
from usdslf.usd.arcs import Variants, in_variants, variants_of
from usdslf.usd.binding import bound_relationship, preview_surface

SCOPE = "SlfMaterials"  # beside an edited Material, for those that a look makes
_FAMILY = "subsetFamily:materialBind:familyType"


class LookLayer:
    """Opinions on the prims of a shot, in a layer that is in no stage yet."""

    def __init__(
        self, stage: Usd.Stage, by_hand: Sdf.Layer | None = None, time: Usd.TimeCode | None = None
    ) -> None:  # fmt: skip
        """Opinions on a stage.

        Args:
            by_hand: opinions that will be in the layer too, whose prims are not to be met by chance.
            time: at which values of the shot are taken; None: default time.
        """
        self.stage, self.by_hand = stage, by_hand
        self.time = Usd.TimeCode.Default() if time is None else time
        self.layer = Sdf.Layer.CreateAnonymous(".usda")
        self.variants: dict[tuple[Sdf.Path, str, str], Sdf.Path] = {}  # that were written in: a prim there
        self._defined: set[Sdf.Path] = set()
        self._painted: dict[Sdf.Path, list[Sdf.AttributeSpec]] = {}  # of a mesh: faces of new GeomSubsets
        self._classes: tuple[tuple[Sdf.Path, Sdf.Path], ...] = ()  # prim and the class that stands for it

    def in_class(self, prim: Sdf.Path, base: Sdf.Path) -> LookLayer:
        """Returns this layer with opinions about `prim` and what is below written to a class that it inherits."""
        view = copy(self)
        view._classes = ((prim, base),)
        return view

    # ---- places ----------------------------------------------------------------------------
    def place(self, path: Sdf.Path) -> Sdf.Path:
        """Returns the path in this layer at which an opinion about a composed prim or property counts."""
        for prim, base in self._classes:
            if path.HasPrefix(prim):
                return path.ReplacePrefix(prim, base)
        instance = self._instance_above(path.GetPrimPath())
        if instance.isEmpty:
            return path
        name = "_slf" + "".join(f"_{e}" for e in str(instance).split("/") if e)
        base = Sdf.Path.absoluteRootPath.AppendChild(name)
        if not self.layer.GetPrimAtPath(base):
            Sdf.PrimSpec(self.layer, name, Sdf.SpecifierClass)
            self.over(instance).inheritPathList.Prepend(base)
        return path.ReplacePrefix(instance, base)

    def over(self, path: Sdf.Path, name: str = "") -> Sdf.PrimSpec:
        """Returns the spec for opinions on a composed prim, or on its property of a name.

        `over`s where there is none yet; inside the variants that hold what shows now.
        """
        place = self.place(path)
        lower = len(path.GetPrefixes()) - len(place.GetPrefixes())  # how much a class takes off the path
        here = []
        for at, group, chosen in self._variants_at(path, name):
            steps = len(at.GetPrefixes()) - lower
            if steps > 0:
                here.append((place.GetPrefixes()[steps - 1], group, chosen))
                self.variants.setdefault((at, group, chosen), path)
        return Sdf.CreatePrimInLayer(self.layer, in_variants(place, tuple(here)))

    def _variants_at(self, path: Sdf.Path, name: str) -> Variants:
        prim = self.stage.GetPrimAtPath(path)
        if prim:
            return variants_of(prim, name)
        parent = path.GetParentPath()  # of a new prim
        return self._variants_at(parent, "") if parent != Sdf.Path.absoluteRootPath else ()

    def define(self, path: Sdf.Path, type_name: str) -> Sdf.PrimSpec:
        """Returns a new prim that the shot does not have, below composed prims."""
        spec = self.over(path)
        spec.specifier, spec.typeName = Sdf.SpecifierDef, type_name
        self._defined.add(path)
        return spec

    def free_path(self, path: Sdf.Path) -> Sdf.Path:
        """Returns `path`, numbered if the shot or this layer has such a prim."""
        candidate, number = path, 1
        while self._is_taken(candidate):
            number += 1
            candidate = path.ReplaceName(f"{path.name}_{number}")
        return candidate

    def _is_taken(self, path: Sdf.Path) -> bool:
        added = self.by_hand.GetPrimAtPath(path) if self.by_hand else None
        if added is not None and added.specifier == Sdf.SpecifierDef:
            return True
        taken = self.stage.GetPrimAtPath(path) or self.layer.GetPrimAtPath(path)
        return bool(taken) or path in self._defined

    def _instance_above(self, path: Sdf.Path) -> Sdf.Path:
        for ancestor in reversed(path.GetPrefixes()[:-1]):
            prim = self.stage.GetPrimAtPath(ancestor)
            if prim and prim.IsInstance():
                return ancestor
        return Sdf.Path.emptyPath

    # ---- opinions --------------------------------------------------------------------------
    def put(self, prim: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: Any) -> Sdf.AttributeSpec:
        """Writes the default value of an attribute."""
        spec = prim.attributes.get(name) or Sdf.AttributeSpec(prim, name, kind, declaresCustom=False)
        spec.default = value
        return spec

    def bind(
        self, target: Sdf.Path, relationship: str, material: Sdf.Path, is_stronger: bool = False
    ) -> None:
        """Binds a material by the relationship whose binding shows there.

        Stronger: also for all that is below, whatever is bound there.
        """
        spec = self.over(target, relationship)
        spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
        rel = spec.relationships.get(relationship) or Sdf.RelationshipSpec(spec, relationship, custom=False)
        rel.targetPathList.ClearEditsAndMakeExplicit()
        rel.targetPathList.explicitItems = [material]
        if is_stronger:
            rel.SetInfo("bindMaterialAs", UsdShade.Tokens.strongerThanDescendants)

    def subset(self, mesh: Usd.Prim, name: str, faces: np.ndarray, material: Sdf.Path) -> list[Sdf.Path]:
        """Makes GeomSubsets of the painted faces that show a material now; returns their paths.

        Faces are taken out of the GeomSubset that binds them now, and out of those of strokes before: families of
        bindings must not overlap.
        """
        new, earlier = [], list(self._painted.get(mesh.GetPath(), ()))
        taken = np.zeros(0, np.int64)
        for old in UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets():
            indices = np.asarray(old.GetIndicesAttr().Get(self.time) or [], np.int64)
            taken = np.union1d(taken, indices)
            inside = np.isin(indices, faces)
            if bound_relationship(old.GetPrim())[0] != material or not inside.any():
                continue
            over = self.over(old.GetPath(), "indices")
            left = np.asarray(over.attributes["indices"].default) if "indices" in over.attributes else indices
            kept = Vt.IntArray.FromNumpy(left[~np.isin(left, faces)].astype(np.int32))
            self.put(over, "indices", Sdf.ValueTypeNames.IntArray, kept)
            new.append(self._subset(mesh, f"{name}_{old.GetPrim().GetName()}", indices[inside]))
        free = np.setdiff1d(faces, taken)
        if len(free) and bound_relationship(mesh)[0] == material:
            new.append(self._subset(mesh, name, free))
        for spec in self._painted.get(mesh.GetPath(), ())[len(earlier) :]:
            for before in earlier:
                kept = np.setdiff1d(np.asarray(before.default), np.asarray(spec.default))
                before.default = Vt.IntArray.FromNumpy(kept.astype(np.int32))
        family = mesh.GetAttribute(_FAMILY)
        if new and (not family or family.Get() not in ("partition", "nonOverlapping")):
            over, uniform = self.over(mesh.GetPath(), _FAMILY), Sdf.VariabilityUniform
            token = over.attributes.get(_FAMILY) or Sdf.AttributeSpec(over, _FAMILY, Sdf.ValueTypeNames.Token, uniform)
            token.default = "nonOverlapping"
        return new

    def _subset(self, mesh: Usd.Prim, name: str, faces: np.ndarray) -> Sdf.Path:
        path = self.free_path(mesh.GetPath().AppendChild(name))
        spec = self.define(path, "GeomSubset")
        names, uniform = Sdf.ValueTypeNames, Sdf.VariabilityUniform
        for attribute, token in (("elementType", "face"), ("familyName", "materialBind")):
            Sdf.AttributeSpec(spec, attribute, names.Token, uniform).default = token
        put = self.put(spec, "indices", names.IntArray, Vt.IntArray.FromNumpy(np.sort(faces).astype(np.int32)))
        self._painted.setdefault(mesh.GetPath(), []).append(put)
        return path


def shader_of(stage: Usd.Stage, material: Sdf.Path) -> UsdShade.Shader:
    """Returns the UsdPreviewSurface of the Material at a path."""
    prim = stage.GetPrimAtPath(material)
    shader = preview_surface(UsdShade.Material(prim)) if prim and prim.IsA(UsdShade.Material) else None
    if shader is None:
        raise AuthorError(f"{material} has no UsdPreviewSurface to edit: bind one to what was painted")
    return shader
