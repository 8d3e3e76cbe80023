"""Parts of a look: which of its opinions a name is for, and what becomes of each by what was said of the names.

    Parts(layer)                    the properties of a look with what they are for, silent ones too
        .named(name) -> paths       of an attribute, an input, a Material, a prim, or a stroke
        .decide(said, is_kept) -> {property: is kept}

A name is an attribute of the look ("/World/mtl/ball/surface.inputs:roughness"), an input of a Material
("/World/mtl/ball.inputs:roughness"), a Material, a prim (what stands on it or below it), a gprim, or a stroke, by path
or name.  In this order: a narrower name overrules a wider one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from pxr import Sdf

from usdslf.errors import InputError
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.opinions import targets_of
from usdslf.usd.layer.silent import silent_specs
from usdslf.usd.look_data import our_data, texts


@dataclass(frozen=True)
class Part:
    """A property of a look.

    Attributes:
        path: where it stands, or stood before it became silent.
        targets: inputs or Materials that it is for.
        strokes: that asked for it.
        is_silent: nobody sees it.
    """

    path: Sdf.Path
    targets: tuple[str, ...]
    strokes: tuple[str, ...]
    is_silent: bool = False

    @property
    def prim(self) -> Sdf.Path:
        """Of it, without variants."""
        return self.path.GetPrimPath().StripAllVariantSelections()

    @property
    def materials(self) -> tuple[str, ...]:
        """Paths of those that it is for."""
        return tuple(dict.fromkeys(t.split(".")[0] for t in self.targets))


@dataclass(frozen=True)
class Shared:
    """A stroke that is not accepted, of several that were answered together.

    Attributes:
        stroke: its path.
        others: of those that stay.
        material: that they ask for together.
    """

    stroke: str
    others: tuple[str, ...]
    material: str

    def in_words(self) -> str:
        """A phrase."""
        return f"{self.stroke}, which asked together with {_some(self.others)} for {self.material}"


@dataclass(frozen=True)
class Parts:
    """The properties of a look layer.

    Attributes:
        parts: in the order of the layer.
        gprims: by gprim the paths of the Materials of the look that it shows; {}: nobody asked the stage.
    """

    parts: tuple[Part, ...]
    gprims: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @staticmethod
    def of(layer: Sdf.Layer, gprims: Mapping[str, tuple[str, ...]] | None = None) -> Parts:
        """Reads a look."""
        found = [(s.path, s, False) for s in specs_of(layer)] + [(at, s, True) for at, s in silent_specs(layer)]
        strokes: dict[str, tuple[str, ...]] = {}  # of a Material, as it is composed and as it is written
        for at, spec, _ in found:
            data = our_data(spec.customData) if isinstance(spec, Sdf.PrimSpec) else {}
            if "strokes" in data:
                said = tuple(texts(data["strokes"]))
                for name in (str(at.StripAllVariantSelections()), str(data.get("material", ""))):
                    strokes[name] = (*strokes.get(name, ()), *said)
        parts = []
        for at, spec, is_silent in found:
            if isinstance(spec, Sdf.PropertySpec):
                targets = targets_of(spec) or _by_place(at, strokes)
                asked = [s for t in targets for s in strokes.get(t.split(".")[0], ())]
                parts.append(Part(at, targets, tuple(dict.fromkeys(asked)), is_silent))
        return Parts(tuple(parts), gprims or {})

    def named(self, name: str) -> set[Sdf.Path]:
        """Returns the properties that a name is for.

        Raises: InputError where it is for none.
        """
        for test in (*self._narrow_first, _is_of_stroke):
            if found := {p.path for p in self.parts if test(p, name)}:
                return found
        raise InputError(f"the look has nothing for {name}; name one of: {_some(self._names())}")

    def has(self, name: str) -> bool:
        """Whether a name is for anything."""
        return any(test(p, name) for p in self.parts for test in (*self._narrow_first, _is_of_stroke))

    def decide(self, said: Mapping[str, bool], is_kept: bool) -> dict[Sdf.Path, dict[str, bool]]:
        """Returns for each property by target whether it is kept.

        Args:
            said: by name whether it is.
            is_kept: what no name is for.

        Raises: InputError for a name that is for nothing.
        """
        for name in said:
            self.named(name)
        return {p.path: {t: self._is_kept(p, t, said, is_kept) for t in p.targets} for p in self.parts}

    def _is_kept(self, part: Part, target: str, said: Mapping[str, bool], is_kept: bool) -> bool:
        alone = Part(part.path, (target,), part.strokes)
        for test in self._narrow_first:
            found = [(len(name), keep) for name, keep in said.items() if test(alone, name)]
            if found:
                return max(found)[1]
        asked = [keep for stroke in part.strokes for name, keep in said.items() if _is_stroke(stroke, name)]
        if any(asked):
            return True
        # What strokes ask together goes with the last of them.
        is_all = len(asked) >= len(part.strokes) > 0
        return False if is_all else is_kept

    def shared_strokes(self, said: Mapping[str, bool], is_kept: bool) -> list[Shared]:
        """Returns the strokes that are not accepted though what they ask for, together with others, is kept.

        Args:
            said, is_kept: as of `decide`.  Where what no name is for is not kept, neither is a stroke without a name,
                unless a narrower name accepts what it asks for.
        """
        decided = self.decide(said, is_kept)
        found: dict[str, Shared] = {}
        for part in (p for p in self.parts if any(decided[p.path].values())):
            of = {s: [keep for name, keep in said.items() if _is_stroke(s, name)] for s in part.strokes}
            is_narrow = any(keep and test(part, n) for n, keep in said.items() for test in self._narrow_first)
            gone = {s for s, keeps in of.items() if keeps and not any(keeps)}
            if not is_kept and not is_narrow:
                gone |= {s for s, keeps in of.items() if not keeps}
            if gone and len(gone) < len(of):
                others = tuple(s for s in of if s not in gone)
                for stroke in part.strokes:
                    if stroke in gone:
                        found.setdefault(stroke, Shared(stroke, others, part.materials[0]))
        return list(found.values())

    @property
    def _narrow_first(self) -> tuple[Callable[[Part, str], bool], ...]:
        return (*_NARROW_FIRST, self._is_on_gprim)

    def _is_on_gprim(self, part: Part, name: str) -> bool:
        shows = self.gprims.get(name, ())
        return bool(shows) and bool(set(part.materials) & set(shows))

    def _names(self) -> list[str]:
        return list(dict.fromkeys(t for p in self.parts for t in p.targets))


def _is_attribute(part: Part, name: str) -> bool:
    return name == str(part.path.StripAllVariantSelections())


def _is_input(part: Part, name: str) -> bool:
    return "." in name and name in part.targets


def _is_material(part: Part, name: str) -> bool:
    return name in part.materials


def _is_at_prim(part: Part, name: str) -> bool:
    return name.startswith("/") and Sdf.Path.IsValidPathString(name) and part.prim.HasPrefix(Sdf.Path(name))


_NARROW_FIRST: tuple[Callable[[Part, str], bool], ...] = (_is_attribute, _is_input, _is_material, _is_at_prim)


def _is_of_stroke(part: Part, name: str) -> bool:
    return any(_is_stroke(s, name) for s in part.strokes)


def _is_stroke(path: str, name: str) -> bool:
    return name in (path, path.rpartition("/")[2])


def _by_place(at: Sdf.Path, materials: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """What a property without notes is for: an input of the Material that it stands in, else its prim."""
    path = at.StripAllVariantSelections()
    home = next((p for p in reversed(path.GetPrimPath().GetPrefixes()) if str(p) in materials), None)
    if home is None:
        return (str(path.GetPrimPath()),)
    return (f"{home}.{path.name}",)


def _some(names: Iterable[str], most: int = 4) -> str:
    found = list(names)
    more = len(found) - most
    return ", ".join(found[:most]) + (f" and {more} more" if more > 0 else "")
