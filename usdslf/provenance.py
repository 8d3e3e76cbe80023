"""How a look came about, in words that it carries, and what another solve of its strokes takes from them.

    words_of_solve(shot, solution) -> str
    words_of_phong(solution) -> str
    program_version() -> str
    said_of_solve(shot, settings, mode) -> dict        how it was solved, name by name
    solved_with(said, strokes) -> SolvedWith           the same, read again from a look
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from usdslf.errors import UsdslfError
from usdslf.inference.weights import Options
from usdslf.shot import Shot
from usdslf.similarity.similarity import Weights
from usdslf.solution import Settings, Solution
from usdslf.strokes.words import NORMS
from usdslf.usd.author.material_writer import MODES

QUALITY = {  # options of `Shot.open` that an answer stands on, and their names in a look
    "elements": "elements", "bounces": "bounces", "refine": "refine", "model": "model", "missing_dome": "missingDome",
    "make_preview": "makePreview",
}  # fmt: skip
KINDS = {"model": str, "missingDome": str, "makePreview": bool}  # of those; all others are numbers
NONE = "the look says {} = {}, which is none: what is usual is taken"
Value = str | int | float | bool


@dataclass(frozen=True)
class SolvedWith:
    """How a look was solved.

    Attributes:
        settings: of the solve.
        mode: as of `author`.
        quality: options of `Shot.open`.
        warnings: sentences about what the look does not say, or says in a way that nobody understands.
    """

    settings: Settings = field(default_factory=Settings)
    mode: str = ""
    quality: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def said_of_solve(shot: Shot, settings: Settings, mode: str) -> dict[str, Value]:
    """Returns how a look was solved, as it says it: all of the light's quality, of the rest what is not as usual.

    Args:
        shot: that was solved.
        settings: of the solve.
        mode: as of `author`.
    """
    s = settings
    said: dict[str, Value | None] = {
        "norm": s.norm, "mode": mode, "weights": _words_of_weights(s.weights) if s.weights else "",
        "similarity": ",".join(f"{float(x)!r}" for x in vars(s.similarity).values()) if s.similarity else "",
        "choose": ",".join(f"{stroke}={choice}" for stroke, choice in sorted(s.choose.items())),
    }  # fmt: skip
    quality: dict[str, Value] = {
        "elements": shot.element_count, "bounces": shot.bounces, "refine": shot.refine, "model": shot.model,
        "missingDome": shot.missing_dome, "makePreview": shot.made is not None,
    }  # fmt: skip
    return {k: v for k, v in said.items() if v} | quality


def solved_with(said: Mapping[str, Any], strokes: Iterable[str]) -> SolvedWith:
    """Reads again how a look was solved.

    Args:
        said: what `said_of_solve` returned, as people and programs left it; empty: of a look that does not say it.
        strokes: names of those that are there: what was chosen for another one is passed over.
    """
    if not said:
        return SolvedWith(warnings=("the look does not say how it was solved: it is solved again with usual settings",))
    names, odd = set(strokes), list[str]()

    def taken(name: str, read: Callable[[str], Any], usual: Any) -> Any:
        try:
            return read(str(said[name])) if name in said else usual
        except (ValueError, TypeError, UsdslfError):
            odd.append(NONE.format(name, said[name]))
            return usual

    settings = Settings(
        taken("norm", _one_of(NORMS), None),
        {stroke: choice for stroke, choice in taken("choose", _pairs, {}).items() if stroke in names},
        taken("weights", _weights, None), taken("similarity", _similarity, None),
    )  # fmt: skip
    mode = taken("mode", _one_of(MODES), "")
    quality = {}
    for option, name in QUALITY.items():
        if type(said.get(name)) is KINDS.get(name, int):
            quality[option] = said[name]
        elif name in said:
            odd.append(NONE.format(name, said[name]))
    return SolvedWith(settings, mode, quality, tuple(odd))


def _words_of_weights(weights: Options) -> str:
    """Weights as `solve --weights` takes them."""
    if weights.factors is not None:
        return ",".join(f"{float(v)!r}" for v in weights.factors)
    other = {f.name: getattr(weights, f.name) for f in fields(weights) if f.name not in ("norm", "factors")}
    return ",".join(f"{k}={float(v)!r}" for k, v in other.items() if v != getattr(Options(), k))


def _weights(text: str) -> Options:
    return Options.of({k: float(v) for k, v in _pairs(text).items()} if "=" in text else tuple(_numbers(text)))


def _similarity(text: str) -> Weights:
    position, normal, reflectance = _numbers(text)
    return Weights(position, normal, reflectance)


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split(",")]


def _pairs(text: str) -> dict[str, str]:
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(name and equals and value for name, equals, value in pairs):
        raise ValueError(text)
    return {name: value for name, _, value in pairs}


def _one_of(known: tuple[str, ...]) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in known:
            raise ValueError(text)
        return text

    return read


def words_of_phong(solution: Solution) -> str:
    """Returns what a look holds that was solved with phong, and how far off it is where that was measured."""
    off = [
        f"{a.residual_after:.3f} becomes {solution.as_preview[a.pool]:.3f}"
        for a in solution.answers
        if a.pool in solution.as_preview and a.chosen.freed
    ]
    measured = f"; the residual of {', '.join(off)}" if off else ""
    return (
        "solved with phong: the look holds its k_d, k_s and width of lobe as diffuse, specular and roughness of "
        f"UsdPreviewSurface, which reflects otherwise, more so at grazing angles{measured}"
    )


def words_of_solve(shot: Shot, solution: Solution) -> str:
    """Returns how a look came about, for its provenance."""
    how = f"{shot.model}, {len(shot.elements)} elements, 1024 directions, {shot.bounces} bounces"
    settings = solution.settings.in_words()
    how += f", {settings}" if settings else ""
    s = solution.stylized
    return how if s is None else f"stylized by {s.amount:g} within {s.radius:g} of the diagonal; {how}"


def program_version() -> str:
    """Returns the version of this program, "unknown" where it is not installed."""
    try:
        return version("usdslf")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
