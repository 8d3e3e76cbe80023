"""Values of command line options: sizes, paths on a picture, colours."""

from __future__ import annotations

import math
import re
from typing import Any

import click

Param = click.Parameter | None
Context = click.Context | None


class Size(click.ParamType):
    """WIDTHxHEIGHT in pixels."""

    name = "WxH"
    largest = 32768

    def convert(self, value: Any, param: Param, ctx: Context) -> tuple[int, int]:
        """Returns (width, height)."""
        if isinstance(value, tuple):
            return value
        found = re.fullmatch(r"(-?\d+)[xX](-?\d+)", str(value))
        if not found:
            self.fail(f"'{value}' is no size; write it like 960x540", param, ctx)
        width, height = int(found[1]), int(found[2])
        if not (0 < width <= self.largest and 0 < height <= self.largest):
            self.fail(f"'{value}' is not between 1x1 and {self.largest}x{self.largest} pixels", param, ctx)
        return width, height


class Path2D(click.ParamType):
    """Points "x,y x,y ..." of a picture, 0..1 from its top left corner."""

    name = '"x,y x,y ..."'

    def convert(self, value: Any, param: Param, ctx: Context) -> list[list[float]]:
        """Returns a list of [x, y]."""
        if isinstance(value, list):
            return value
        points = [numbers(p) for p in str(value).split()]
        if not points or any(p is None or len(p) != 2 for p in points):
            self.fail(f"'{value}' is no path; write it like \"0.4,0.5 0.45,0.52\"", param, ctx)
        return [p for p in points if p is not None]


class Color3(click.ParamType):
    """R,G,B."""

    name = "R,G,B"

    def convert(self, value: Any, param: Param, ctx: Context) -> list[float]:
        """Returns [r, g, b]."""
        found = value if isinstance(value, list) else numbers(str(value))
        if found is None or len(found) != 3:
            self.fail(f"'{value}' is no colour; write three numbers like 0.6,0.1,0.05", param, ctx)
        return found


class Offset(click.ParamType):
    """X,Y on the picture or X,Y,Z in the world."""

    name = "X,Y[,Z]"

    def convert(self, value: Any, param: Param, ctx: Context) -> list[float]:
        """Returns [x, y] or [x, y, z]."""
        found = value if isinstance(value, list) else numbers(str(value))
        if found is None or len(found) not in (2, 3):
            self.fail(f"'{value}' is no offset; write it like 0.2,0 (picture) or 1.5,0,0 (world)", param, ctx)
        return found


class Choose(click.ParamType):
    """STROKE=ID: the alternative that a stroke takes."""

    name = "STROKE=ID"

    def convert(self, value: Any, param: Param, ctx: Context) -> tuple[str, str]:
        """Returns (stroke's name, id)."""
        if isinstance(value, tuple):
            return value
        stroke, equals, choice = str(value).partition("=")
        if not (stroke and equals and choice):
            self.fail(f"'{value}' says no choice; write it like stroke_0001=specular", param, ctx)
        return stroke.rsplit("/", 1)[-1], choice


class ChoiceWeights(click.ParamType):
    """A,B,C or NAME=X,NAME=X: what a choice weighs by."""

    name = "A,B,C | NAME=X,..."

    def convert(self, value: Any, param: Param, ctx: Context) -> tuple[float, ...] | dict[str, float]:
        """Returns factors, or weights by name."""
        if isinstance(value, tuple | dict):
            return value
        if "=" not in str(value):
            found = numbers(str(value))
            if found is None:
                self.fail(f"'{value}' is no list of weights; write it like 1,5,25 or group=8,freedom=2", param, ctx)
            return tuple(found)
        weights = {}
        for part in str(value).split(","):
            key, _, text = part.partition("=")
            one = numbers(text)
            if not key.strip() or one is None or len(one) != 1:
                self.fail(f"'{part}' is no weight; write it like group=8", param, ctx)
            weights[key.strip()] = one[0]
        return weights


class Similarity(click.ParamType):
    """POSITION,NORMAL,REFLECTANCE: how much each counts where things are alike."""

    name = "POSITION,NORMAL,REFLECTANCE"

    def convert(self, value: Any, param: Param, ctx: Context) -> tuple[float, float, float]:
        """Returns three weights."""
        if isinstance(value, tuple):
            return value
        found = numbers(str(value))
        if found is None or len(found) != 3:
            self.fail(f"'{value}' is not three weights; write them like 0.25,0.25,2", param, ctx)
        return found[0], found[1], found[2]


def numbers(text: str) -> list[float] | None:
    """Returns the finite numbers of "a,b,...", None where it is something else."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return found if all(map(math.isfinite, found)) else None
