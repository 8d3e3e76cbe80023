"""Accept: a look that holds what was accepted of another one, and says what was left out.

    accept_look(shot, look, out, wish) -> Accepted     writes `out`; the look stays as it is
    shared_strokes(shot, look, wish) -> [Shared]       rejected strokes that only another solve can leave out
    Wish                                               what is accepted and rejected, by name

What no name is for is accepted, unless something is asked for by `only`.  A property that several inputs share (scale
of a packed texture) keeps the channels that are accepted, the others are as the shot has them.  A Material that is
accepted for some of its gprims becomes a new one that inherits it and is bound to those.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pxr import Gf, Sdf, Usd, Vt

from usdslf.contents import file_hash
from usdslf.errors import InputError
from usdslf.usd.author.author import check_look_place
from usdslf.usd.author.variants import AS_IT_WAS, flatten_variants, variant_name, variants_in
from usdslf.usd.author.whole import whole_or_as_before
from usdslf.usd.binding import bound_relationship, gprims_of, parts_of
from usdslf.usd.border import quiet_usd
from usdslf.usd.files import write_layer
from usdslf.usd.layer.hand_edits import RECORD, added_by_hand, record_of, specs_of, what_is_by_hand
from usdslf.usd.layer.moved_look import carry_textures, move_paths
from usdslf.usd.layer.opinions import base_of, channels_of
from usdslf.usd.layer.parts import Part, Parts, Shared
from usdslf.usd.layer.silent import SILENT, prune
from usdslf.usd.look_data import KEY, our_data, texts
from usdslf.usd.review.narrowed import narrow
from usdslf.usd.review.review import over_its_shot
from usdslf.usd.review.toggle import open_look

_PARAMETERS = {
    "diffuse": ("diffuseColor",),
    "specular": ("specularColor", "ior", "metallic", "useSpecularWorkflow"),
    "glossiness": ("roughness",),
}
_NUMBERS = "rgba"


@dataclass(frozen=True)
class Again:
    """Why a look that is accepted is not the one that was reviewed.

    Attributes:
        look: file of the one that was.
        without: paths of the strokes that it was solved again without.
    """

    look: str
    without: tuple[str, ...]


@dataclass(frozen=True)
class Wish:
    """What is accepted of a look.

    Attributes:
        only: names of what is; none: all.
        but: names of what is not.
        said: by name whether it is accepted, of a verdict file.
        by: who decided, for provenance.
        verdict: the file, for provenance.
        choose: by Material or stroke which of the alternatives that the look holds is left, without the others.
        again: the look is one that was solved again; names that are for nothing in it are passed over.
    """

    only: tuple[str, ...] = ()
    but: tuple[str, ...] = ()
    said: Mapping[str, bool] = field(default_factory=dict)
    by: str = ""
    verdict: str = ""
    choose: Mapping[str, str] = field(default_factory=dict)
    again: Again | None = None

    @property
    def names(self) -> dict[str, bool]:
        """By name whether it is accepted."""
        return dict(self.said) | dict.fromkeys(self.only, True) | dict.fromkeys(self.but, False)


@dataclass(frozen=True)
class Accepted:
    """What became of a look.

    Attributes:
        path: of the new look.
        kept, left_out: inputs of Materials.
        textures: files that it has beside it.
        warnings: sentences.
    """

    path: str
    kept: tuple[str, ...]
    left_out: tuple[str, ...]
    textures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in vars(self).items()}


def accept_look(
    shot: str | os.PathLike[str], look: str | os.PathLike[str], out: str | os.PathLike[str], wish: Wish | None = None
) -> Accepted:
    """Writes what is accepted of a look as a look of its own, with the textures that it needs.

    Args:
        shot: with or without the look.
        out: another file than the look, beside it or elsewhere.
        wish: None: all is accepted.

    Raises: StageError for the shot, InputError for the look, for a name that is for nothing in it, and for what cannot
        be accepted in part; AuthorError where `out` cannot be written.
    """
    wish = wish or Wish()
    layer = open_look(look)
    if os.path.realpath(look) == os.path.realpath(out):
        raise InputError(f"{out} is the look itself, which stays as it is: choose another file")
    stage, below = over_its_shot(shot, look)
    check_look_place(below, out)
    with quiet_usd(), whole_or_as_before(out) as said:
        chosen = _choose(layer, wish.choose)
        by_hand = {str(p) for p in what_is_by_hand(added_by_hand(layer))}
        work = _Accepting(layer, Parts.of(layer, _shown(stage, layer)), below, wish)
        work.take_out()
        move_paths(layer, Path(look).parent, Path(out).parent)
        textures = carry_textures(layer, Path(look), Path(out))
        data = our_data(layer.customLayerData)
        data["accepted"] = work.provenance(Path(look)) | ({"chosen": Vt.StringArray(chosen)} if chosen else {})
        data[RECORD] = Vt.StringArray([x for x in record_of(layer) if x.split(" ")[0] not in by_hand])
        layer.customLayerData = {**layer.customLayerData, KEY: data}
        write_layer(layer, out)
    kept, left = work.told()
    return Accepted(os.fspath(out), kept, left, tuple(str(t) for t in textures), (*work.warnings, *said))


def shared_strokes(
    shot: str | os.PathLike[str], look: str | os.PathLike[str], wish: Wish
) -> list[Shared]:  # fmt: skip
    """Returns the strokes that a wish does not accept, and that a layer cannot be without: others asked with them.

    Raises: StageError for the shot, InputError for the look and for a name that is for nothing in it.
    """
    layer = open_look(look)
    stage, _ = over_its_shot(shot, look)
    with quiet_usd():
        parts = Parts.of(layer, _shown(stage, layer))
    for name in wish.names:
        parts.named(name)
    # A material that is rejected for one gprim is left on others.
    names = {name: keep for name, keep in wish.names.items() if keep or name not in parts.gprims}
    return parts.shared_strokes(names, not wish.only)


def _choose(layer: Sdf.Layer, choose: Mapping[str, str]) -> list[str]:
    """Leaves one of the alternatives of Materials; returns what was chosen, in words."""
    found = []
    for name, explanation in choose.items():
        those = {at: names for at, names in variants_in(layer).items() if name in _names_of(layer, at)}
        if not those:
            raise InputError(f"the look has no alternatives for {name}: solve with --alternatives")
        for at, names in those.items():
            chosen = AS_IT_WAS if explanation == "none" else variant_name(explanation)
            if chosen not in names:
                raise InputError(f"{at} has no alternative {explanation}; choose from {', '.join(names)}")
            flatten_variants(layer, at, chosen)
            found.append(f"{at}={explanation}")
    return found


def _names_of(layer: Sdf.Layer, material: Sdf.Path) -> set[str]:
    """What a Material with alternatives is called: itself, the shot's, and its strokes, by path and name."""
    spec = layer.GetPrimAtPath(material)
    names = {str(material), *map(str, spec.specializesList.GetAddedOrExplicitItems())}
    for group in spec.variantSets.values():
        for variant in group.variants.values():
            strokes = texts(our_data(variant.primSpec.customData).get("strokes"))
            names |= set(strokes)
    return names | {n.rpartition("/")[2] for n in names}


def _shown(stage: Usd.Stage, layer: Sdf.Layer) -> dict[str, tuple[str, ...]]:
    """By gprim or GeomSubset the Material of the look that it shows."""
    ours = {m for p in Parts.of(layer).parts for m in p.materials}
    found: dict[str, tuple[str, ...]] = {}
    for gprim in gprims_of(stage):
        for part in parts_of(gprim):
            material = str(bound_relationship(part)[0])
            if material in ours:
                found[str(part.GetPath())] = (material,)
    return found


class _Accepting:
    """A copy of a look while what is rejected is taken out of it."""

    def __init__(self, layer: Sdf.Layer, parts: Parts, below: Usd.Stage, wish: Wish) -> None:
        self.layer, self.parts, self.below = layer, parts, below
        self.warnings: list[str] = []
        self.wish = wish
        names = {n: keep for n, keep in wish.names.items() if not (wish.again and not parts.has(n))}
        for name in names:
            parts.named(name)
        gprims = {name: names.pop(name) for name in list(names) if name in parts.gprims}
        self.decided = parts.decide(names, not wish.only)
        self.warnings += [f"{x.in_words()}, stays" for x in parts.shared_strokes(names, not wish.only)]
        self.partly = self._by_gprim(gprims)
        for targets in self.decided.values():
            for target in targets:
                if target.split(".")[0] in self.partly:
                    targets[target] = bool(self.partly[target.split(".")[0]])

    def _by_gprim(self, said: Mapping[str, bool]) -> dict[str, tuple[str, ...]]:
        """By Material that something is said of by gprim: the gprims that it is accepted for."""
        found: dict[str, tuple[str, ...]] = {}
        for material in {m for g in said for m in self.parts.gprims[g]}:
            users = [g for g, shows in self.parts.gprims.items() if material in shows]
            usual = any(keep for t in self.decided.values() for name, keep in t.items() if _is_of(name, material))
            found[material] = tuple(g for g in users if said.get(g, usual))
        return found

    def take_out(self) -> None:
        """Removes what is rejected, and what then holds nothing."""
        users = {m: [g for g, shows in self.parts.gprims.items() if m in shows] for m in self.partly}
        gone: list[Sdf.Path] = []
        for part in self.parts.parts:
            keep = self.decided[part.path]
            if all(keep.values()):
                continue
            spec = self._spec(part)
            if not any(keep.values()) or not self._without_channels(spec, keep):
                gone.append(spec.path)
                spec.owner.RemoveProperty(spec)
        prune(self.layer, [p.GetPrimPath() for p in gone])
        self._without_stray_materials()
        self._say_less()
        for material, kept in self.partly.items():
            if kept and len(kept) < len(users[material]):
                narrow(self.layer, self.below, material, kept, users[material])

    def _spec(self, part: Part) -> Sdf.PropertySpec:
        home = Sdf.Path.absoluteRootPath.AppendChild(SILENT)
        at = part.path.ReplacePrefix(Sdf.Path.absoluteRootPath, home) if part.is_silent else part.path
        return self.layer.GetPropertyAtPath(at)

    def _without_channels(self, spec: Sdf.PropertySpec, keep: Mapping[str, bool]) -> bool:
        """Puts back the channels of a shared value that only rejected inputs take; whether it could be done."""
        of, base = channels_of(spec), base_of(spec)
        kept = "".join(of[t] for t, is_kept in keep.items() if is_kept)
        lost = [c for t, is_kept in keep.items() if not is_kept for c in of[t] if c not in kept]
        if isinstance(spec, Sdf.AttributeSpec) and isinstance(base, list) and len(base) == 4 and all(of.values()):
            value = Gf.Vec4f(spec.default)
            for channel in lost:
                value[_NUMBERS.index(channel)] = base[_NUMBERS.index(channel)]
            spec.default = value
        data = our_data(spec.customData)
        names = [t for t, is_kept in keep.items() if is_kept]
        data["of"] = Vt.StringArray(names)
        if "channels" in data:
            data["channels"] = Vt.StringArray([of[t] for t in names])
        spec.SetInfo("customData", {**spec.customData, KEY: data})
        return True

    def _without_stray_materials(self) -> None:
        """Takes out Materials of the look whose every opinion was rejected, with what binds them."""
        left = {t for p in specs_of(self.layer) if isinstance(p, Sdf.PropertySpec) for t in channels_of(p) if "." in t}
        for material in {m for p in self.parts.parts for m in p.materials}:
            had = any("." in t and _is_of(t, material) for p in self.parts.parts for t in p.targets)
            if not had or any(_is_of(t, material) for t in left):
                continue
            rest = [s for s in specs_of(self.layer) if isinstance(s, Sdf.PropertySpec) and material in channels_of(s)]
            paths = [s.path for s in rest]
            for spec in rest:
                spec.owner.RemoveProperty(spec)
            mine = [s for s in specs_of(self.layer) if isinstance(s, Sdf.PrimSpec) and _material_of(s) == material]
            prune(self.layer, [p.GetPrimPath() for p in paths] + [s.path for s in mine])

    def _say_less(self) -> None:
        """Says on a Material that lost an input what is left of its change."""
        for spec in specs_of(self.layer):
            if not isinstance(spec, Sdf.PrimSpec) or not (material := _material_of(spec)):
                continue
            keeps = {t: k for d in self.decided.values() for t, k in d.items() if "." in t and _is_of(t, material)}
            if all(keeps.values()):
                continue
            left = {t.rpartition("inputs:")[2] for t, k in keeps.items() if k}
            data = our_data(spec.customData)
            freed = [n for n in str(data.get("inferred", "")).split("+") if set(_PARAMETERS.get(n, ())) & left]
            data["inferred"] = "+".join(freed) or "none"
            data.pop("residualAfter", None)
            spec.SetInfo("customData", {**spec.customData, KEY: data})
            if "specularColor" in left and keeps.get(f"{material}.inputs:useSpecularWorkflow") is False:
                self.warnings.append(f"{material}: specularColor shows nothing without useSpecularWorkflow")

    def told(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The inputs that are kept, and those that are left out."""
        keeps: dict[str, bool] = {}
        for part in self.parts.parts:
            for target, keep in self.decided[part.path].items():
                keeps[target] = keeps.get(target, False) or keep
        return tuple(t for t, k in keeps.items() if k), tuple(t for t, k in keeps.items() if not k)

    def provenance(self, look: Path) -> dict[str, Any]:
        """What the new look says of how it came about."""
        kept_of = {m: ", ".join(k) for m, k in self.partly.items() if k}
        again = self.wish.again
        reviewed = Path(again.look) if again else look
        data: dict[str, Any] = {
            "look": reviewed.name,
            "lookHash": file_hash(reviewed),
            "leftOut": Vt.StringArray(list(self.told()[1])),
            "partOf": Vt.StringArray([f"{m} for {k}" for m, k in kept_of.items()]),
        }
        wish = self.wish
        if again:
            data["solvedWithout"] = Vt.StringArray(list(again.without))
        return data | {k: v for k, v in (("by", wish.by), ("verdict", wish.verdict)) if v}


def _is_of(target: str, material: str) -> bool:
    return target == material or target.startswith(f"{material}.")


def _material_of(spec: Sdf.PrimSpec) -> str:
    data = our_data(spec.customData)
    return str(data.get("material") or spec.path.StripAllVariantSelections()) if data else ""
