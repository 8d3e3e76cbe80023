"""How a look came about, in words that it carries.

    words_of_solve(shot, solution) -> str
    words_of_phong(solution) -> str
    program_version() -> str
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

from usdslf.shot import Shot
from usdslf.solution import Solution


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
    how += f", {solution.how}" if solution.how else ""
    s = solution.stylized
    return how if s is None else f"stylized by {s.amount:g} within {s.radius:g} of the diagonal; {how}"


def program_version() -> str:
    """Returns the version of this program, "unknown" where it is not installed."""
    try:
        return version("usdslf")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"
