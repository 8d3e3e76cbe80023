"""What public docstrings leave out: parameters, shapes, units, results, errors, and the source of a method."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

SHAPE = re.compile(r"\(\s*(\w[\w +]*)?(,\s*[\w +]*)*\)")  # (n, 3), (T,), (h, w, 3 or more), ()
UNITS = {  # parameters and attributes by name -> words of which one has to stand in what is said of them
    "points": ("stage units",),
    "widths": ("stage units",),
    "eye": ("stage units",),
    "colors": ("working space",),
    "color": ("working space",),
    "image": ("working space",),
    "radius": ("fraction", "stage units"),
    "strength": ("0..1",),
    "frame": ("time code",),
    "clone_offset": ("stage units",),
    "barycentric": ("0..1",),
    "diagonal": ("stage units",),
    "bounds": ("stage units",),
    "meters_per_unit": ("metres",),
    "size": ("pixels", "components"),
}
SOURCE = ("solve", "Session.solve", "Session.stylize", "Shot.visibility", "Shot.light_field")


def entries(doc: str) -> dict[str, str]:
    """What is said of each name under Args and Attributes: `name: text`, or `a, b: text`, with lines that go on."""
    found: dict[str, str] = {}
    for section in re.findall(r"^(?:Args|Attributes):\n((?:[ ]+.*\n?|\n)+)", inspect.cleandoc(doc) + "\n", re.M):
        names: list[str] = []
        for line in textwrap.dedent(section).splitlines():
            head = re.match(r"([\w, ]+?): (.*)", line)
            if head:
                names = [n.strip() for n in head[1].split(",")]
            found |= {n: (found.get(n, "") + " " + (head[2] if head else line.strip())).strip() for n in names}
    return found


def has_arrays(annotation: Any) -> bool:
    """Whether a type is of arrays."""
    return any(word in str(annotation) for word in ("NDArray", "ndarray", "ArrayLike", "F32", "F64", "I32"))


def raised(function: Callable[..., Any]) -> set[str]:
    """The errors of the user's that a function raises itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [n.exc for n in ast.walk(tree) if isinstance(n, ast.Raise) and n.exc is not None]
    names = [ast.unparse(c.func if isinstance(c, ast.Call) else c) for c in calls]
    return {n for n in names if n.endswith(("Error", "Error_"))} - {"AttributeError", "TypeError", "ValueError"}


def units_missing(name: str, text: str) -> bool:
    """Whether a quantity of which we know that it has a unit or a range is said without it."""
    return name in UNITS and not any(word in text for word in UNITS[name])


def gaps_of_function(name: str, function: Callable[..., Any]) -> Iterator[str]:
    """What the docstring of a function or method does not say."""
    doc = inspect.getdoc(function) or ""
    if not doc:
        yield f"{name}: no docstring"
        return
    said = entries(doc)
    signature = inspect.signature(function)
    given = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
    for p in given:
        own = said.get(p.name, doc if len(given) == 1 and re.search(rf"\b{p.name}|\b{p.name[:-1]}", doc) else None)
        if own is None:
            yield f"{name}: nothing on the parameter {p.name}"
        elif has_arrays(p.annotation) and not SHAPE.search(own):
            yield f"{name}: no shape of {p.name}"
        elif units_missing(p.name, own):
            yield f"{name}: no unit or range of {p.name}"
    what = signature.return_annotation
    if what not in (None, "None", inspect.Signature.empty):
        if not re.search(r"\b(Reads|Opens|[Rr]eturns?|[Yy]ields?)\b", doc):
            yield f"{name}: nothing on what it returns"
        if has_arrays(what) and not SHAPE.search(doc):
            yield f"{name}: no shape of what it returns"
    for error in raised(function):
        if error not in doc.partition("Raises:")[2]:
            yield f"{name}: raises {error} and does not say so"
    if name in SOURCE and "Source:" not in doc:
        yield f"{name}: no source"


def gaps_of_class(name: str, kind: type) -> Iterator[str]:
    """What the docstrings of a class and of its public members do not say."""
    doc = kind.__dict__.get("__doc__") or ""
    if not doc.strip() or doc.startswith(f"{kind.__name__}("):
        yield f"{name}: no docstring"
    said = entries(doc)
    fields = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    for f in fields:
        if f.name.startswith("_"):
            continue
        if f.name not in said:
            yield f"{name}: nothing on the attribute {f.name}"
        elif has_arrays(f.type) and not SHAPE.search(said[f.name]):
            yield f"{name}: no shape of {f.name}"
        elif units_missing(f.name, said[f.name]):
            yield f"{name}: no unit or range of {f.name}"
    own_bases = [base for base in kind.__mro__ if base.__module__.split(".")[0] == kind.__module__.split(".")[0]]
    members = {member: value for base in reversed(own_bases) for member, value in vars(base).items()}
    for member, value in members.items():
        if member.startswith("_") and member != "__init__":
            continue
        value = value.__func__ if isinstance(value, staticmethod | classmethod) else value
        getter = getattr(value, "fget", None) or getattr(value, "func", None) or getattr(value, "_make", None)
        if getter is not None:
            own = inspect.getdoc(getter) or ""
            if not own:
                yield f"{name}.{member}: no docstring"
            elif has_arrays(inspect.signature(getter).return_annotation) and not SHAPE.search(own):
                yield f"{name}.{member}: no shape"
            elif units_missing(member, own):
                yield f"{name}.{member}: no unit or range"
        elif inspect.isfunction(value) and not (member == "__init__" and dataclasses.is_dataclass(kind)):
            if member == "__init__" and not inspect.getdoc(value):
                continue
            yield from gaps_of_function(f"{name}.{member}", value)


def gaps(module: ModuleType) -> list[str]:
    """Returns what the docstrings of a module's public names do not say, one line each."""
    out: list[str] = []
    for name in module.__all__:
        value = getattr(module, name)
        if isinstance(value, type):
            out += gaps_of_class(name, value)
        elif callable(value):
            out += gaps_of_function(name, value)
        if not name.startswith("__") and not re.search(rf"^    (\w+, )*{name}\b", module.__doc__ or "", re.M):
            out.append(f"{name}: not in the list of public names that {module.__name__} begins with")
    return out
