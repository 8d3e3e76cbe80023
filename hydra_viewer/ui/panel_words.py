"""Text of the panels Understood, Strokes, Compare and Review; the rest is in words.py."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

# ── Understood ────────────────────────────────────────────────────────────────────────────────────
NOTHING_PAINTED = "Paint on the picture how a surface should look.\nWhat is understood of it is said here."
LOOKING = "Looking at the strokes …"
NOT_LOOKED = "The strokes were not looked at to the end. Ctrl+R looks again."
FOLLOWING = "In the light as it was; what the change sends round is being followed …"
CHOSEN = "shown"
ALTERNATIVES = "Or did you mean"
QUESTION = "Which did you mean?"
QUESTION_TIP = "Both explain the paint about equally well"
PICTURE_COMES = "…"
NOT_POSSIBLE = "cannot be written"
BY_HAND, BY_YOU = "chosen by you", "by you"
LET_DECIDE = ("Let it decide", "Take the likeliest explanation again")
NEXT_DAB = ("Where to dab next", "Mark the place where one more dab tells the leading explanations apart, with the "
            "colour that each expects there")  # fmt: skip
DECIDES, HARDLY_DECIDES = "one dab here decides", "a dab here helps, but does not decide alone"
SCOPE_TITLE = "The change goes on to"
SCOPES = {
    "stroke": ("Painted", "Only the faces under the stroke"),
    "prim": ("Object", "Only the painted gprims"),
    "material": ("Material", "All that shows the material"),
    "similar": ("Similar", "The material, and what is like the painted place"),
}
SHOW_SCOPE = ("Show what changes", "Mark on the picture what the scope covers")
EFFECTS = "In this picture"
EFFECT_KINDS = {
    (True, True): "painted", (False, True): "shares the material", (False, False): "by its light",
    (True, False): "painted, by its light",
}  # fmt: skip
SHARED = "Also shown by"
NOT_PAINTED = "not painted"
MAKING_PICTURES = "Making pictures of the explanations"
STOP = ("✕", "Stop making pictures")

# ── Strokes ───────────────────────────────────────────────────────────────────────────────────────
STROKES_PANEL = "Strokes"
NO_STROKES = "No strokes yet: paint on the picture."
COLUMNS = ("Stroke", "Painted on", "Understood as")
SWITCHED_OFF = "off"
DELETE = ("Delete", "Remove the selected strokes")
UP, DOWN = ("Up", "Move it before the one above"), ("Down", "Move it behind the one below")
SOLVE_AGAIN = ("Solve again", "Find anew what the strokes ask for")
STROKE_COLOR = ("Colour", "Paint the selected strokes in another colour")
FIELDS = {
    "tool": "Tool", "mode": "Mode", "scope": "Scope", "norm": "Change", "space": "Colour is", "strength": "Strength",
}  # fmt: skip
SEVERAL = "—"
DELETED, MOVED, SWITCHED, RECOLORED = "delete of strokes", "order of strokes", "switching strokes", "colour of strokes"

# ── Compare ───────────────────────────────────────────────────────────────────────────────────────
COMPARE_PANEL, COMPARE_MENU, UNDERSTANDING_MENU = "Compare", "C&ompare", "&Understood"
MODES = {
    "now": ("Now", "The picture as it is now"),
    "other": ("Before", "What it is compared with, alone"),
    "wipe": ("Wipe", "What it is compared with on the left of a line that can be dragged"),
    "difference": ("Difference", "How far the two are apart"),
}
MODE_KEYS = {"now": "", "other": "\\", "wipe": "V", "difference": "Shift+V"}
COMPARE_WITH, BEFORE = "With", "Before: the shot without the look"
GAIN, TIMES = "Gain", "\u00d7 "
KEEP = ("Keep this look", "Remember the look as it is now, to flip to and compare with")
DROP = ("Forget", "Forget the selected look")
FLIP_ON, FLIP_BACK = ("Next look", "Show the next kept look"), ("Previous look", "Show the previous kept look")
SNAPSHOTS = "Kept looks"
SNAPSHOT_TIP = "Enter shows it, Delete forgets it"

# ── Review ────────────────────────────────────────────────────────────────────────────────────────
REVIEW_PANEL = "Review"
REVIEW = ("&Review the look", "What the saved look changes, with pictures, and what is wrong with it")
SAVE_VERDICT = ("Save ver&dict …", "Write what is accepted and rejected, for: usdslf accept --verdict")
SAVE_PAGE = ("Save p&age …", "Write this review as one HTML file to send, as usdslf review does")
REVIEW_COLUMNS = ("Accept", "Before → after", "State")
NOT_REVIEWED = "Save the look, then review it. What is unchecked is rejected."
SAVE_FIRST = "there is no look file yet: save the strokes and the look first"
NOTE = "Note on the selected change"
JSON_FILES, HTML_FILES = "JSON (*.json)", "HTML (*.html)"
REVIEW_PICTURE = "Picture of the review"
REVIEW_PICTURE_TIP = "Drag, or left and right arrow: move the wipe"
REVIEW_VIEW_TIP = "From where it is looked at: where strokes were painted from, where nobody looked, and in other light"
REVIEW_MODES = {
    "before": ("Before", "The shot without the look"),
    "after": ("After", "The shot with the look"),
    "wipe": ("Wipe", "Before on the left, after on the right"),
    "blink": ("Blink", "Before and after in turns"),
    "difference": ("Difference", "How far the two are apart, magnified by the gain"),
    "indirect": ("Light", "What changes without being edited itself: the difference of the light that it sends"),
}
REVIEW_GAIN = "What the difference, and what changes by light, are magnified by"
PICTURES_COME = "Making pictures …"
PAINTED_FROM, HELD_OUT, OTHER_LIGHT = "painted from", "nobody painted from", "in other light"
VIEW_KINDS = {"stroke": PAINTED_FROM, "held out": HELD_OUT, "light": OTHER_LIGHT}
OFF = ("Switch off", "Keep the change in the look, silent, as usdslf toggle does; it stays off when strokes are saved")
ON = ("Switch on", "Let the change show again")
WEIGHED = "Explanations that were weighed"
REVIEW_PAINTED, REVIEW_BEFORE, REVIEW_AFTER = "painted", "seen before", "seen after"
HASH = re.compile("[0-9a-f]{40,}")
SURVIVES, FINDINGS, FROM = "Will it survive?", "Findings", "Where it comes from"
ALL_SURVIVES = "No rule says that another program shows it otherwise."
NO_FINDINGS = "None."


# ── keys to the panels ────────────────────────────────────────────────────────────────────────────
PANELS_MENU = "Pa&nels"
GO_TO_PICTURE = ("Go to the &picture", "Keys are the picture's: Esc gives a stroke up, B changes the brush")
PANEL_KEYS = {"Stage": "F3", "Brush": "F4", "Understood": "F6", "Strokes": "F7", "Compare": "F8", "Review": "F9"}


def go_to(title: str) -> tuple[str, str]:
    """Returns the words of the action that gives a panel the keys."""
    return f"Go to {title}", "Tab and Shift+Tab walk through its controls, space presses them"


def view_name(name: str, kind: str) -> str:
    """Returns the name of a view of a review."""
    return f"{name.rsplit('/', 1)[-1]} ({VIEW_KINDS[kind]})" if kind in VIEW_KINDS else name


def asked_by(strokes: Sequence[str]) -> str:
    """Returns which strokes asked for a change."""
    names = ", ".join(s.replace("stroke_", "").lstrip("0") or s for s in strokes)
    return f"Asked for by {of_strokes(names, len(strokes))}"


def residuals(before: float, after: float) -> str:
    """Returns how near to the paint it came."""
    return f"Off what was painted by {before:.2f} before, {after:.2f} after"


def weighed(title: str, chance_of_it: float, cost: float | None) -> tuple[str, str, str]:
    """Returns an explanation that was weighed, by columns."""
    return title, chance(chance_of_it), "not admitted" if cost is None else f"cost {cost:.1f}"


def changes_too(names: Sequence[str]) -> str:
    """Returns what changes and was not painted."""
    more_of_them = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"Changes too, {NOT_PAINTED}: {', '.join(names[:3])}{more_of_them}"


def provenance(values: Mapping[str, object]) -> str:
    """Returns where a look comes from, a line each; of hashes the beginning."""
    rows = {name: value for name, value in values.items() if value not in ("", None)}
    parts = {name: value.items() for name, value in rows.items() if isinstance(value, Mapping)}
    said = {name: ", ".join(f"{k} {v}" for k, v in of) for name, of in parts.items()}
    hashes = {name: value for name, value in rows.items() if isinstance(value, str) and HASH.fullmatch(value)}
    said |= {name: f"{value[:16]} …" for name, value in hashes.items()}
    return "\n".join(f"{name}: {said.get(name, value)}" for name, value in rows.items())


def summary(counts: Mapping[str, int]) -> str:
    """Returns what a look changes, and whether that is well, in a line."""
    said = [_count(counts[what], what) for what in ("materials", "inputs", "gprims")]
    said.append(f"{counts['not_painted']} of them not painted" if counts["not_painted"] else "all of them painted")
    wrong = [_count(counts[what], what) for what in ("findings", "risks") if counts[what]]
    wrong += ["stale"] if counts["stale"] else []
    wrong += [] if counts["wins"] else ["some edits are hidden"]
    return f"{', '.join(said)}; {', '.join(wrong) or 'nothing is wrong with it'}"


def _count(count: int, what: str) -> str:
    return f"{count} {what[:-1] if count == 1 else what}"


def not_written(path: str, why: str) -> str:
    """Returns why a file cannot be written."""
    return f"{path} cannot be written ({why}): choose another place"


def chose(title: str) -> str:
    """Returns the name of the step of undo that a choice is."""
    return f"choice of {title}"


def edited(field: str, value: str) -> str:
    """Returns the name of the step of undo that an edit of strokes is."""
    return f"{FIELDS[field].lower()} {value}"


def shared_by(count: int, first: str) -> str:
    """Returns who else shows a material."""
    more = f" and {count - 1} more" if count > 1 else ""
    return f"{SHARED} {first}{more} ({NOT_PAINTED})"


def chance(share: float) -> str:
    """Returns how likely an explanation is."""
    return f"{100 * share:.0f} %" if share >= 0.01 else "below 1 %"


def of_strokes(names: str, count: int) -> str:
    """Returns which strokes something is of."""
    return f"strokes {names}" if count > 1 else f"stroke {names}"


def understood_as(title: str, is_by_hand: bool) -> str:
    """Returns what a stroke was taken for."""
    return f"{title} ({BY_YOU})" if is_by_hand else title


def effect(name: str, change: float, kind: str) -> str:
    """Returns how far the picture of a gprim changes, and why."""
    return f"{name}  {100 * change:.0f} %  <span style='color:#8c8c8c'>{kind}</span>"


def more(count: int) -> str:
    """Returns how many are not listed."""
    return f"and {count} more"


def choice(number: int) -> tuple[str, str]:
    """Returns the words of the action that takes an explanation by its number."""
    return f"Take explanation &{number}", "Of the strokes that were painted last"
