"""Understanding: what strokes were taken for, as what a panel says and offers.

    understood(shot, found) -> tuple[Understood, ...]     one for what strokes ask for together
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hydra_viewer.model.found import Found
from usdslf import About, Remark, Shot, Stroke, report_of

Values = tuple[float, ...]
TITLES = {"diffuse": "diffuse colour", "specular": "specular colour", "glossiness": "glossiness"}
NOTHING = "nothing changes"
MOST = 4  # alternatives that are offered
OF_MATERIAL = " of "  # in the id of an indirect stroke's explanation


@dataclass(frozen=True)
class ParameterChange:
    """What becomes of a parameter.

    Attributes:
        name: diffuse | specular | roughness.
        before, after: (1) or (3) values 0..1.
        low, high: between which the paint may be meant, 90 %; () where that is not known.
    """

    name: str
    before: Values
    after: Values
    low: Values = ()
    high: Values = ()

    @property
    def is_color(self) -> bool:
        """Whether it is shown as a swatch."""
        return len(self.after) == 3

    @property
    def in_words(self) -> str:
        """Such as "roughness 0.30 → 0.12"."""
        return f"{self.name} {value_in_words(self.before)} → {value_in_words(self.after)}"

    @property
    def range_in_words(self) -> str:
        """What the paint allows; "" where that is not known."""
        return f"the paint allows {value_in_words(self.low)} to {value_in_words(self.high)}" if self.low else ""


@dataclass(frozen=True)
class Alternative:
    """An explanation that was weighed.

    Attributes:
        id: as `Stroke.choice` and `Settings.choose` take it.
        title: what would change, in words.
        chance: 0..1 that this is what was meant; None: not weighed against the others.
        changes: that it would make.
        is_chosen: this is the one that is shown.
    """

    id: str
    title: str
    chance: float | None
    changes: tuple[ParameterChange, ...]
    is_chosen: bool

    @property
    def brief(self) -> str:
        """What would change, where there is little room."""
        return brief_of(self.id)


@dataclass(frozen=True)
class Understood:
    """What was inferred from strokes that ask for something together.

    Attributes:
        strokes: their names.
        material: path of what changes.
        changes: of it; () where nothing changes.
        explained: share 0..1 of what was painted that the change brings about.
        alternatives: all that can be chosen, the likeliest first; the chosen one is among them.
        rival: id of the explanation that is about as likely; "": none, or the choice was made by hand.
        is_chosen_by_hand: a person chose it.
        painted: paths of the gprims that strokes lie on.
        sharing: paths of the gprims that show the material and are not painted.
        also: sentences on further materials that change.
        notes: sentences.
        scope: of the first stroke.
        varies: the change differs from place to place; values are means.
    """

    strokes: tuple[str, ...]
    material: str
    changes: tuple[ParameterChange, ...]
    explained: float
    alternatives: tuple[Alternative, ...]
    rival: str = ""
    is_chosen_by_hand: bool = False
    painted: tuple[str, ...] = ()
    sharing: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    scope: str = "material"
    varies: bool = False

    @property
    def sentence(self) -> str:
        """Such as "roughness 0.30 → 0.12 on /World/mtl/ball, explains 94 % of the stroke"."""
        what = ", ".join(c.in_words for c in self.changes) or NOTHING
        whose = "strokes" if len(self.strokes) > 1 else "stroke"
        if not self.changes:
            return f"{what} on {self.material}"
        return f"{what} on {self.material}, explains {100 * self.explained:.0f} % of the {whose}"

    @property
    def chosen(self) -> Alternative | None:
        """The explanation that is shown."""
        return next((a for a in self.alternatives if a.is_chosen), None)

    @property
    def question(self) -> tuple[Alternative, ...]:
        """The two that are about as likely, the chosen one first; () where there is no question."""
        asked = self.alternative(self.rival) if self.rival else None
        return (self.chosen, asked) if self.chosen is not None and asked is not None else ()

    @property
    def offered(self) -> tuple[Alternative, ...]:
        """Those that can be chosen, as many as there is room for, the chosen one among them; () where it is alone."""
        if len(self.alternatives) < 2:
            return ()
        first = self.question
        rest = tuple(a for a in self.alternatives[:MOST] if a not in first)
        chosen = self.chosen
        if chosen is not None and chosen not in (*first, *rest):
            rest = (*rest[: MOST - 1], chosen)
        return first + rest

    def alternative(self, id_: str) -> Alternative | None:
        """Returns the alternative of an id; None where there is none."""
        return next((a for a in self.alternatives if a.id == id_), None)


def understood(shot: Shot, found: Found) -> tuple[Understood, ...]:
    """Returns what strokes were taken for, those that were asked together in one, in the order of the strokes.

    Args:
        shot: that the strokes are on.
        found: what they ask for.
    """
    by_path = {s.path: s for s in found.strokes}
    groups: list[tuple[dict[str, Any], list[Stroke]]] = []
    for entry in report_of(shot, found.solution)["strokes"]:
        stroke, same = by_path[entry["path"]], {k: v for k, v in entry.items() if k not in ("path", "surface")}
        for known, strokes in groups:
            if known == same:
                strokes.append(stroke)
                break
        else:
            groups.append((same, [stroke]))
    return tuple(_understood(shot, entry, strokes, found.solution.warnings) for entry, strokes in groups)


def value_in_words(values: Sequence[float]) -> str:
    """Returns values with two decimals: 0.30, or 0.30 0.20 0.10 of a colour."""
    return " ".join(f"{v:.2f}" for v in values)


def title_of(id_: str) -> str:
    """Returns what an explanation changes, in words: "diffuse colour and glossiness of ring"."""
    what, _, of = id_.partition(OF_MATERIAL)
    if what in ("", "none"):
        return NOTHING
    names = [TITLES.get(name, name) for name in what.split("+")]
    said = " and ".join((", ".join(names[:-1]), names[-1])) if len(names) > 1 else names[0]
    return f"{said} of {of.rsplit('/', 1)[-1]}" if of else said


def brief_of(id_: str) -> str:
    """Returns what an explanation changes, where there is little room: "diffuse + glossiness of ring"."""
    what, _, of = id_.partition(OF_MATERIAL)
    names = what.split("+")
    if what in ("", "none"):
        return NOTHING
    said = "all three" if len(names) == len(TITLES) else " + ".join(names)
    return f"{said} of {of.rsplit('/', 1)[-1]}" if of else said


def _understood(
    shot: Shot, entry: Mapping[str, Any], strokes: Sequence[Stroke], warnings: Sequence[str]
) -> Understood:  # fmt: skip
    painted = tuple(dict.fromkeys(path for s in strokes for path in s.surfaces))
    changes = _changes(entry["before"], entry["after"], entry["range"])
    alternatives = _alternatives(entry)
    by_hand = any(s.choice for s in strokes)
    before = max(float(entry["residual_before"]), 1e-9)
    return Understood(
        tuple(s.name for s in strokes), entry["material"], changes,
        1 - min(float(entry["residual_after"]) / before, 1.0), alternatives,
        _rival(alternatives) if entry["ambiguous"] and not by_hand else "", by_hand, painted,
        tuple(p for p in _showing(shot, entry["material"]) if p not in painted), _also(entry),
        (*_notes(entry), *_said_of(strokes, warnings)),
        strokes[0].scope, bool(entry["varies"]),
    )  # fmt: skip


def _changes(
    before: Mapping[str, Any], after: Mapping[str, Any], ranges: Mapping[str, Any]
) -> tuple[ParameterChange, ...]:
    return tuple(
        ParameterChange(name, _tuple(before[name]), _tuple(after[name]), *(_tuple(e) for e in ranges.get(name, ())))
        for name in after
        if name in before and before[name] != after[name]
    )


def _alternatives(entry: Mapping[str, Any]) -> tuple[Alternative, ...]:
    """Those that can be chosen: the likeliest first, what changes nothing last."""
    found = []
    for each in entry["alternatives"]:
        # an indirect stroke's explanation names its materials, and its id in the report does so by itself
        is_chosen = each["id"] == entry["inferred"] or (each is entry["alternatives"][0] and "materials" in each)
        if each["cost"] is None and not is_chosen:
            continue
        before = entry["before"] if "materials" not in each else {}
        changes = _changes(before, each["after"], {})
        title = title_of(each["id"])
        # nothing is chosen where nothing comes near the paint: then how likely it was says nothing
        chance = None if is_chosen and title == NOTHING else each.get("probability")
        found.append(Alternative(each["id"], title, chance, changes, is_chosen))
    return tuple(sorted(found, key=lambda a: (a.title == NOTHING, -(a.chance or 0.0))))


def _said_of(strokes: Sequence[Stroke], warnings: Sequence[str]) -> tuple[str, ...]:
    """What a solve says of strokes beside its answer, without their names; a near tie is asked as a question."""
    mine = {s.path for s in strokes}
    remarks = [w for w in warnings if isinstance(w, Remark) and mine & set(w.strokes) and w.about is not About.TIE]
    return tuple(dict.fromkeys(r.what for r in remarks))


def _rival(alternatives: Sequence[Alternative]) -> str:
    """The other one of a near tie; where nothing changes as nothing comes near the paint, there is none."""
    if any(a.is_chosen and a.title == NOTHING for a in alternatives):
        return ""
    others = [a for a in alternatives if not a.is_chosen and a.title != NOTHING]
    return others[0].id if others else ""


def _showing(shot: Shot, material: str) -> list[str]:
    """The gprims that show a material."""
    scene = shot.scene
    which = [i for i, m in enumerate(scene.materials) if m.path == material]
    return [m.path for m in scene.meshes if any(i in m.material_of_triangle for i in which)]


def _also(entry: Mapping[str, Any]) -> tuple[str, ...]:
    said = []
    for each in entry.get("also", ()):
        changes = ", ".join(c.in_words for c in _changes(each["before"], each["after"], {}))
        said.append(f"{each['material']}: {changes or NOTHING}")
    return tuple(said)


def _notes(entry: Mapping[str, Any]) -> tuple[str, ...]:
    notes = [entry["note"]] if entry.get("note") else []
    if entry["varies"]:
        notes.append("the change varies over the surface; the values are means")
    notes += [f"it stands on a texture that cannot be read: {file}" for file in entry.get("stands_on", ())]
    return tuple(notes)


def _tuple(value: float | Sequence[float]) -> Values:
    return tuple(value) if isinstance(value, (list, tuple)) else (float(value),)  # type: ignore[arg-type]
