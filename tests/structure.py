"""Measures how the program is built, from its source: `python tests/structure.py` prints a table.

Rooms are the folders and single modules directly in `usdslf`; an arrow is a room that imports another one, a level the
longest way down from a room that nothing else is above.  A circle is a set of modules, or of rooms, that import each
other.  Imports inside functions count, those for type checkers alone do not.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("usdslf", "hydra_viewer")
LONGEST_MODULE, LONGEST_FUNCTION, MOST_PARAMETERS = 400, 60, 8
PLAIN_BASES = {"Protocol", "NamedTuple", "Enum", "Generic", "Exception"}  # call nothing by name
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Module:
    """A module: its dotted name, its text and what that parses to."""

    name: str
    text: str
    tree: ast.Module

    @property
    def lines(self) -> int:
        """How long it is."""
        return len(self.text.splitlines())

    @property
    def room(self) -> str:
        """The folder or the single module of the package that it belongs to."""
        return ".".join(self.name.split(".")[:2])


@cache
def read_modules(root: Path = ROOT) -> dict[str, Module]:
    """Returns all modules of the program by name."""
    found = {}
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            text = file.read_text(encoding="utf-8")
            found[name] = Module(name, text, ast.parse(text))
    return found


def executed(tree: ast.AST) -> Iterator[ast.AST]:
    """All nodes but those below `if TYPE_CHECKING`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        yield from executed(node)


def imports_of(module: Module, names: Iterable[str]) -> set[str]:
    """Returns which of the modules `names` a module imports."""
    known, found = set(names), set()
    for node in executed(module.tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inside & known or {node.module}
            found |= {node.module} if inside - known else set()
    return (found & known) - {module.name}


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Returns the sets of two or more nodes that all reach each other."""
    reach = {node: set(ends) for node, ends in arrows.items()}
    grown = True
    while grown:
        grown = False
        for ends in reach.values():
            more = set().union(*(reach[e] for e in ends)) - ends if ends else set()
            grown |= bool(more)
            ends |= more
    sets = {tuple(sorted(m for m in ends if node in reach[m])) for node, ends in reach.items() if node in ends}
    return [list(s) for s in sorted(sets) if len(s) > 1]


def levels(arrows: dict[str, set[str]]) -> int:
    """Returns how many nodes the longest way down passes; arrows have no circles."""
    known: dict[str, int] = {}

    def depth(node: str) -> int:
        if node not in known:
            known[node] = 0
            known[node] = 1 + max((depth(end) for end in arrows[node]), default=0)
        return known[node]

    return max(map(depth, arrows))


def functions(module: Module) -> Iterator[tuple[str, Function]]:
    """All functions and methods of a module with their qualified names."""

    def walk(node: ast.AST, prefix: str) -> Iterator[tuple[str, Function]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, Function):
                yield f"{prefix}{child.name}", child
            named = isinstance(child, Function | ast.ClassDef)
            yield from walk(child, f"{prefix}{child.name}." if named else prefix)

    yield from walk(module.tree, f"{module.name}:")


def parameters(function: Function) -> int:
    """Returns how many parameters a call can give: without self, and star arguments as one each."""
    a = function.args
    named = [*a.posonlyargs, *a.args, *a.kwonlyargs]
    own = 1 if named and named[0].arg in ("self", "cls") else 0
    return len(named) - own + (a.vararg is not None) + (a.kwarg is not None)


def references(node: ast.AST) -> Iterator[str]:
    """The names that a piece of source reads, calls, imports, or gives as a string."""
    for n in ast.walk(node):
        if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load):
            yield n.id
        elif isinstance(n, ast.Attribute):
            yield n.attr
        elif isinstance(n, ast.ImportFrom):
            yield from (alias.name for alias in n.names)
        elif isinstance(n, ast.Constant) and isinstance(n.value, str) and n.value.isidentifier():
            yield n.value


def unused(found: dict[str, Module], public: Iterable[str]) -> list[str]:
    """Returns functions, methods and classes that nothing in the program refers to by name, but for public ones.

    Args:
        found: modules by name.
        public: names of functions and classes that users call; so are the public methods of these classes.

    What is handed on by its decorator (a command, a callback at exit) counts as used, as do names with two underscores
    at each end and methods of classes with a base from elsewhere, which may be called there.
    """
    users, own = set(public), Counter[str]()
    uses = Counter(name for m in found.values() for name in references(m.tree))
    things = []
    for m in found.values():
        for node in ast.walk(m.tree):
            holder = node if isinstance(node, ast.ClassDef) else None
            for child in ast.iter_child_nodes(node):
                if isinstance(child, Function | ast.ClassDef):
                    things.append((m.name, holder, child))
    for _, _, thing in things:
        own[thing.name] += sum(name == thing.name for child in thing.body for name in references(child))
    classes = {thing.name: thing for _, _, thing in things if isinstance(thing, ast.ClassDef)}

    def is_ours(thing: ast.ClassDef) -> bool:
        bases = [ast.unparse(b).split("[")[0] for b in thing.bases]
        return all(b in PLAIN_BASES or (b in classes and is_ours(classes[b])) for b in bases)

    out = []
    for module, holder, thing in things:
        handed_on = any(word in ast.unparse(d) for d in thing.decorator_list for word in ("command", "register"))
        of_public = holder is not None and holder.name in users and not thing.name.startswith("_")
        overrides = holder is not None and not is_ours(holder)
        is_named = thing.name in users or (thing.name.startswith("__") and thing.name.endswith("__"))
        if uses[thing.name] <= own[thing.name] and not (handed_on or of_public or overrides or is_named):
            out.append(f"{module}:{holder.name + '.' if holder else ''}{thing.name}")
    return sorted(out)


@dataclass(frozen=True)
class Structure:
    """What was measured.  Rooms and modules with their arrows; long things with their size, largest first."""

    rooms: dict[str, set[str]]
    modules: dict[str, set[str]]
    lines: dict[str, int]
    long_functions: list[tuple[int, str]]
    many_parameters: list[tuple[int, str]]

    @property
    def circles(self) -> list[list[str]]:
        """Circles among modules, then among rooms."""
        return circles(self.modules) + circles(self.rooms)

    @property
    def long_modules(self) -> list[tuple[int, str]]:
        """Modules above 400 lines."""
        return sorted(((n, name) for name, n in self.lines.items() if n > LONGEST_MODULE), reverse=True)


def measure(root: Path = ROOT) -> Structure:
    """Reads the program and measures it."""
    found = read_modules(root)
    arrows = {name: imports_of(m, found) for name, m in found.items()}
    rooms: dict[str, set[str]] = {m.room: set() for m in found.values()}
    for name, ends in arrows.items():
        rooms[found[name].room] |= {found[e].room for e in ends}
    for room, ends in rooms.items():
        ends -= {room}
    every = [(name, f) for m in found.values() for name, f in functions(m)]
    sizes = [(f.end_lineno - f.lineno + 1, name) for name, f in every if f.end_lineno]
    counts = [(parameters(f), name) for name, f in every]
    return Structure(
        rooms,
        arrows,
        {name: m.lines for name, m in found.items()},
        sorted(((n, name) for n, name in sizes if n > LONGEST_FUNCTION), reverse=True),
        sorted(((n, name) for n, name in counts if n > MOST_PARAMETERS), reverse=True),
    )


def table(s: Structure) -> str:
    """Returns the measurements as lines of text."""
    rows = [
        ("modules", f"{len(s.lines)}, {sum(s.lines.values())} lines"),
        ("rooms", str(len(s.rooms))),
        ("arrows", str(sum(map(len, s.rooms.values())))),
        ("circles", "; ".join(" <-> ".join(c) for c in s.circles) or "0"),
        ("levels", str(levels(s.rooms)) if not circles(s.rooms) else "none: rooms have circles"),
        ("longest module", "{1}, {0}".format(*max((n, name) for name, n in s.lines.items()))),
        ("median module", f"{median(s.lines.values()):g}"),
        (f"modules above {LONGEST_MODULE} lines", str(len(s.long_modules))),
        (f"functions above {LONGEST_FUNCTION} lines", str(len(s.long_functions))),
        (f"functions with more than {MOST_PARAMETERS} parameters", str(len(s.many_parameters))),
    ]
    lines = [f"{name:42} {value}" for name, value in rows]
    lines += [f"  {n:4} {name}" for n, name in [*s.long_modules, *s.long_functions, *s.many_parameters]]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(measure()))
