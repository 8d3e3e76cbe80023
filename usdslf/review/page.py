"""The page of a review: one file that holds all it shows, and asks nothing of a network.

    page_of(review) -> str                      HTML, from templates/
    write_pictures(folder, review) -> [paths]   before, after and their difference of each view, as EXR and PNG
    shown(text) -> str                          text with what could hide or turn other text written out

Each picture is in the page once, as a PNG; what a mode shows (wipe, difference, heat map) is made of
those.
"""

from __future__ import annotations

import base64
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from usdslf.color import Color, color_of
from usdslf.edits.collateral import words_of
from usdslf.errors import InputError
from usdslf.outputs import write_picture
from usdslf.review.review import Review, ReviewedView
from usdslf.textures.images import png_bytes
from usdslf.usd.border import in_words
from usdslf.usd.review.records import ReviewedEdit

TEMPLATES = Path(__file__).parent / "templates"
FAINT = 0.01  # of white on the display: indirect effects below it look as small as they are
_COLORS = ("diffuse", "specular")
_ORDER = ("constant", "texture", "scale", "primvar", "connection", "binding", "faces", "node")
_HIDDEN = ("Cc", "Cf", "Zl", "Zp", "Co", "Cs")  # categories of what cannot be seen, or turns what is beside it


def page_of(review: Review, than: str = "") -> str:
    """Returns the page of a review as HTML; names from the shot are in it as text.

    Args:
        than: file of the look that `before` is of, of a comparison; "": it is the shot.
    """
    values, color = review.as_values(), color_of(review.scene.ocio or None, review.scene.working_space)
    pictures: dict[str, str] = {}
    ends = [Path(than).name, Path(review.look.look).name] if than else ["before", "after"]
    data = _data(review, values, color, pictures) | {"ends": ends, "is_diff": bool(than)}
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= {"shown": shown, "words": words_of, "plural": lambda n: "" if n == 1 else "s"}
    raw = {name: Markup((TEMPLATES / f"page.{name}").read_text("utf-8")) for name in ("css", "js")}
    return environment.get_template("page.html").render(
        r=values, is_diff=bool(than), ends=ends, title=" | ".join(ends) if than else Path(review.look.look).name,
        shot_name=Path(review.look.shot).name, data=data, pictures=pictures,
        view=f"{color.display_name}, {color.view_name}", **raw,
    )  # fmt: skip


def shown(value: object) -> str:
    """Returns text in which control, formatting and direction marks are written as \\uXXXX."""
    text = in_words(value) if isinstance(value, float | list | tuple | dict) else str(value)
    return "".join(f"\\u{ord(c):04x}" if unicodedata.category(c) in _HIDDEN else c for c in text)


def write_pictures(folder: Path, review: Review) -> list[Path]:
    """Writes before, after and their difference of each view as EXR, and as PNG through the display.

    Raises: InputError where the folder cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}; choose another folder") from None
    found = []
    for number, seen in enumerate(review.views):
        p = seen.pictures
        named = {"before": p.before, "after": p.after, "difference": p.after - p.before}
        for name, picture in named.items():
            for suffix in (".exr", ".png"):
                file = folder / f"view_{number:02d}_{name}{suffix}"
                absolute = np.abs(picture) if name == "difference" and suffix == ".png" else picture
                write_picture(file, {"color": absolute}, review.scene, exposure=p.exposure)
                found.append(file)
    return found


def _data(
    review: Review, values: Mapping[str, Any], color: Color, pictures: dict[str, str]
) -> dict[str, Any]:
    """What the page's script shows."""
    rows = {g.path: i for i, g in enumerate(review.look.gprims)}
    materials = []
    for m, record in zip(values["materials"], review.look.materials, strict=True):
        materials.append(m | {
            "rows": [rows[g] for g in record.gprims if g in rows],
            "colors": {k: _swatches(m[k], color) for k in ("before", "after")},
            "alternative_colors": [_swatches(a["after"], color) for a in m["alternatives"]],
        })  # fmt: skip
    return {
        "look_name": Path(review.look.look).name,
        "look_hash": review.look.look_hash,
        "verdict_name": f"{Path(review.look.look).stem}.verdict.json",
        "materials": materials,
        "changes": _changes(review.look.edits, color),
        "strokes": values["strokes"],
        "strokes_gone": values["strokes_gone"],
        "gprims": values["gprims"],
        "views": [_view(i, seen, v, color, pictures) for i, (seen, v) in enumerate(zip(review.views, values["views"]))],
    }


def _view(
    number: int, seen: ReviewedView, values: Mapping[str, Any], color: Color, pictures: dict[str, str]
) -> dict[str, Any]:
    """One view, whose pictures go to `pictures`."""
    p = seen.pictures
    names = {name: f"{name}_{number}" for name in ("before", "after", "parts", "indirect_map")}
    scale = float(np.percentile(p.indirect, 99.8)) if p.indirect.size else 0.0
    scale = max(scale, FAINT / 2**p.exposure)
    row = p.gprim + 1
    parts = np.stack([row & 255, row >> 8, np.zeros_like(row)], -1) / 255
    pixels: dict[str, NDArray] = {
        "before": color.display(p.before, p.exposure), "after": color.display(p.after, p.exposure),
        "parts": parts, "indirect_map": (p.indirect / scale)[..., None],
    }  # fmt: skip
    for name, picture in pixels.items():
        encoded = base64.b64encode(png_bytes(picture)).decode("ascii")
        pictures[names[name]] = f"data:image/png;base64,{encoded}"
    strokes = []
    for stroke, of in zip(seen.strokes, values["strokes"], strict=True):
        ends = {"target": stroke.target, "before": stroke.seen_before, "after": stroke.seen_after}
        hexes = {f"{name}_color": _hex(c, color, p.exposure) for name, c in ends.items() if c}
        strokes.append(of | hexes | {"dabs": [list(d) for d in stroke.dabs]})
    return {**values, **names, "indirect_scale": scale, "strokes": strokes}


def _changes(edits: Sequence[ReviewedEdit], color: Color) -> list[dict[str, Any]]:
    """The table of changes: Materials, their inputs, and of each input the opinion that says most."""
    groups: dict[str, dict[str, list[ReviewedEdit]]] = {}
    for edit in edits:
        for target in edit.targets:
            material, _, name = target.partition(".")
            groups.setdefault(material, {}).setdefault(name, []).append(edit)
    found = []
    for material, inputs in groups.items():
        rows = [_change(material, name, of, color) for name, of in sorted(inputs.items()) if name or len(inputs) == 1]
        found.append({"material": material, "inputs": rows})
    return found


def _change(material: str, name: str, edits: list[ReviewedEdit], color: Color) -> dict[str, Any]:
    own_first = {name: 0, "inputs:file": 1}
    first = min(edits, key=lambda e: (_ORDER.index(e.representation), own_first.get(e.attribute, 2)))
    hidden = next((e for e in edits if not e.wins and not e.is_off), None)
    own = name.removeprefix("inputs:") or "binding"
    label = own if first.attribute in (name, "") else f"{own}: {first.attribute.removeprefix('inputs:')}"
    is_color = "olor" in own and first.representation in ("constant", "texture")
    return {
        "name": label,
        "target": f"{material}.{name}" if name else "",
        "before": first.before,
        "after": first.after,
        "before_color": _hex(first.before, color) if is_color else None,
        "after_color": _hex(first.after, color) if is_color else None,
        "representation": first.representation,
        "more": len(edits) - 1,
        "wins": hidden is None and any(e.wins for e in edits),
        "hidden_by": hidden.hidden_by if hidden else "",
        "off": all(e.is_off for e in edits),
        "drifted": next((e.drifted for e in edits if e.drifted), ""),
    }


def _swatches(means: Mapping[str, Any], color: Color) -> dict[str, str | None]:
    return {k: _hex(means[k], color) for k in _COLORS if k in means}


def _hex(value: Any, color: Color, exposure: float = 0.0) -> str | None:
    """A scene-linear colour as the display shows it; None for what is none."""
    if not isinstance(value, list | tuple) or len(value) != 3 or not all(isinstance(x, int | float) for x in value):
        return None
    shown_ = np.clip(color.display(np.asarray(value, np.float32)[None, None], exposure), 0, 1)[0, 0]
    return "#" + "".join(f"{round(float(x) * 255):02x}" for x in shown_)
