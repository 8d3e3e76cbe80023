"""Strokes <-> stroke layer: BasisCurves with SlfStrokeAPI under /SlfStrokes, seen in any USD program.

    read_strokes(path, warnings=None) -> list[Stroke]       StrokeError for what cannot be meant
    write_strokes(path, strokes, shot_stage) -> None        same strokes, same bytes; AuthorError

Every property is written, and only points, widths, displayColor, slf:eye and slf:tool are needed to read a
stroke.  What people added to the layer by hand is kept.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from usdslf.errors import AuthorError, StrokeError
from usdslf.replacing import is_file
from usdslf.strokes.remarks import About, Remark
from usdslf.strokes.stroke import Stroke, validate_stroke
from usdslf.usd.border import reading
from usdslf.usd.files import write_layer
from usdslf.usd.schema import API_SCHEMA, register_schema
from usdslf.usd.shot_metadata import copy_shot_metadata, shot_files

SCOPE = "SlfStrokes"
_MEND = "restore it or paint into a new one"
ORIGIN = "xformOp:translate:slfOrigin"  # that points and eyes of a stroke are relative to
Names = Sdf.ValueTypeNames
_TOKENS = {f"slf:{field}": field for field in ("tool", "mode", "space", "norm", "scope")}


def read_strokes(path: str | os.PathLike[str], warnings: list[str] | None = None) -> list[Stroke]:
    """Reads the strokes of a layer, those that are switched off too, in the order of its prims.

    A stroke layer whose strokes were all removed gives none.

    Args:
        path: of the layer, or of a stage that composes one.
        warnings: a list to which a sentence is added for each thing that was made up or left out.

    Raises:
        StrokeError: no such file, not USD, no strokes in it, or a stroke that cannot be meant.
    """
    register_schema()
    said = warnings if warnings is not None else []
    if not is_file(path, StrokeError):
        raise StrokeError(f"there is no stroke layer {path}: paint one with `usdslf stroke`")
    with reading(path, StrokeError, _MEND):
        stage = Usd.Stage.Open(_open_layer(path), None, load=Usd.Stage.LoadAll)
        prims = [p for p in _all_prims(stage.GetPseudoRoot()) if _is_stroke(p)]
        if not prims and not (stage.GetDefaultPrim() and stage.GetDefaultPrim().GetName() == SCOPE):
            raise StrokeError(f"{path} holds no strokes: paint one with `usdslf stroke`")
        strokes = [_read_stroke(prim, said) for prim in prims]
    for stroke in strokes:
        validate_stroke(stroke)
    return strokes


def write_strokes(path: str | os.PathLike[str], strokes: Sequence[Stroke], shot_stage: Usd.Stage) -> None:
    """Writes the strokes, and only them, to a stroke layer; the order of strokes is the order of prims.

    A stroke layer that is there keeps what it holds beside strokes; a failure leaves it as it was.

    Args:
        path: of the layer, new or a stroke layer.
        strokes: all that the layer is to hold, by distinct names.
        shot_stage: Usd.Stage of the shot, whose units, up axis and times the layer takes over.

    Raises:
        StrokeError: a stroke cannot be meant, two have one name, or the file is not a stroke layer.
        AuthorError: the file is part of the shot, or cannot be written.
    """
    register_schema()
    for stroke in strokes:
        validate_stroke(stroke)
    names = [s.name for s in strokes]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise StrokeError(f"two strokes have the name {twice[0]}: rename one")
    if Path(path).resolve() in shot_files(shot_stage):
        raise AuthorError(f"{path} is part of the shot, which is never written to: choose another file")
    layer = Sdf.Layer.CreateAnonymous(".usda")
    if is_file(path, AuthorError) and Path(path).stat().st_size:
        earlier = _open_layer(path)
        if earlier.defaultPrim != SCOPE:
            raise StrokeError(f"{path} exists and is not a stroke layer: choose another file")
        layer.TransferContent(earlier)
    with Sdf.ChangeBlock():
        copy_shot_metadata(shot_stage, layer)
        layer.defaultPrim = SCOPE
        scope = layer.GetPrimAtPath(f"/{SCOPE}") or Sdf.PrimSpec(layer, SCOPE, Sdf.SpecifierDef, "Scope")
        for spec in [s for s in scope.nameChildren if _is_stroke_spec(s) and s.name not in names]:
            del scope.nameChildren[spec.name]
        for stroke in strokes:
            _write_stroke(scope, stroke)
        others = [s.name for s in scope.nameChildren if s.name not in names]
    write_layer(_reordered(layer, scope.path, names + others), path)


def _open_layer(path: str | os.PathLike[str]) -> Sdf.Layer:
    with reading(path, StrokeError, _MEND):
        layer = Sdf.Layer.FindOrOpen(str(path))
    if not layer:
        raise StrokeError(f"{path} is not a readable USD file, {_MEND}")
    return layer


def _all_prims(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """Prims that are switched off included, which a stage's own traversal leaves out."""
    for child in prim.GetAllChildren():
        yield child
        yield from _all_prims(child)


def _is_stroke(prim: Usd.Prim) -> bool:
    applied = prim.GetPrimTypeInfo().GetAppliedAPISchemas() or _listed(prim.GetMetadata("apiSchemas"))
    return API_SCHEMA in applied or prim.HasAttribute("slf:tool")


def _is_stroke_spec(spec: Sdf.PrimSpec) -> bool:
    return API_SCHEMA in _listed(spec.GetInfo("apiSchemas")) or "slf:tool" in spec.attributes


def _listed(op: Sdf.TokenListOp | None) -> list[str]:
    return list(op.GetAddedOrExplicitItems()) if op else []


def _value(prim: Usd.Prim, name: str) -> Any:
    """The value as it was painted: the default, else the first time sample."""
    attribute = prim.GetAttribute(name)
    value = attribute.Get() if attribute else None
    return attribute.Get(Usd.TimeCode.EarliestTime()) if attribute and value is None else value


def _array(prim: Usd.Prim, name: str, width: int, dtype: type = np.float32) -> NDArray:
    value = _value(prim, name)
    shape = (-1, width) if width > 1 else (-1,)
    if value is None:
        return np.zeros((0, width) if width > 1 else 0, dtype)
    try:
        return np.array(value, dtype).reshape(shape)
    except (TypeError, ValueError, OverflowError):
        raise StrokeError(_no_number(prim, name)) from None


def _vector(prim: Usd.Prim, name: str) -> tuple[float, float, float]:
    found = _array(prim, name, 3, np.float64)
    x, y, z = found[0].tolist() if len(found) else (0.0, 0.0, 0.0)
    return x, y, z


def _number(prim: Usd.Prim, name: str, fallback: float) -> float:
    value = _value(prim, name)
    try:
        return fallback if value is None else float(value)
    except (TypeError, ValueError):
        raise StrokeError(_no_number(prim, name)) from None


def _no_number(prim: Usd.Prim, name: str) -> str:
    return f"stroke {prim.GetPath()} has {name} that is no number of its kind: paint it again or remove it"


def _read_stroke(prim: Usd.Prim, said: list[str]) -> Stroke:
    path = str(prim.GetPath())
    needed = ("points", "widths", "primvars:displayColor", "slf:eye")
    missing = [name for name in needed if not len(_array(prim, name, 1))]
    missing += ["slf:tool"] if _value(prim, "slf:tool") is None else []
    if missing:
        raise StrokeError(f"stroke {path} has no {', '.join(missing)}: paint it again or remove it")
    points = _array(prim, "points", 3)
    n = len(points)
    counts = tuple(int(c) for c in _array(prim, "curveVertexCounts", 1, np.int64)) or (n,)
    if counts == (1,):  # a dab that another program wrote as one point
        counts, points, n = (2,), np.repeat(points, 2, 0), 2
    elif sum(counts) != n or min(counts) < 2:
        raise StrokeError(f"stroke {path} has curves of {list(counts)} points for {n}: paint it again")

    def rows(name: str, width: int) -> NDArray:
        return _one_per_point(path, name, _array(prim, name, width), counts)

    world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    origin = _vector(prim, ORIGIN)
    if not (np.isfinite(world).all() and np.isfinite(origin).all()):
        raise StrokeError(f"stroke {path} has a transform that is not finite: paint it again or remove it")
    scale = abs(np.linalg.det(world[:3, :3])) ** (1 / 3)
    normals = _array(prim, "normals", 3)
    color = _array(prim, "primvars:displayColor", 3)
    if len(indices := _array(prim, "primvars:displayColor:indices", 1, np.int64)):
        if indices.min() < 0 or indices.max() >= len(color):
            raise StrokeError(f"stroke {path} has displayColor indices out of range: paint it again")
        color = color[indices]
    tokens: dict[str, Any] = {f: _value(prim, name) for name, f in _TOKENS.items()}
    tokens = {f: str(value) for f, value in tokens.items() if value is not None}
    return Stroke(
        name=prim.GetName(),
        points=(points @ world[:3, :3] + (world[3, :3] - origin)).astype(np.float32),
        widths=(rows("widths", 1) * scale).astype(np.float32),
        colors=_one_per_point(path, "primvars:displayColor", color, counts),
        eye=rows("slf:eye", 3),
        normals=normals if len(normals) == n else np.zeros((0, 3), np.float32),
        curve_counts=counts,
        strength=_number(prim, "slf:strength", 1.0),
        frame=_number(prim, "slf:timeCode", math.nan),
        choice=str(_value(prim, "slf:choice") or ""),
        clone_offset=_vector(prim, "slf:cloneOffset"),
        film_normal=_vector(prim, "slf:filmNormal"),
        active=prim.IsActive(),
        prim=path,
        origin=origin,
        **_read_anchors(prim, n, said),
        **tokens,
    )


def _read_anchors(prim: Usd.Prim, n: int, said: list[str]) -> dict[str, Any]:
    """Where n points lie on which surfaces; without what belongs together there is nothing of it."""
    anchors: dict[str, Any] = {"surface_index": _array(prim, "slf:surfaceIndex", 1, np.int32)}
    anchors["face"] = _array(prim, "slf:face", 1, np.int32)
    anchors["barycentric"] = _array(prim, "slf:barycentric", 2)
    relation = prim.GetRelationship("slf:surfaces")
    surfaces = tuple(str(p) for p in relation.GetTargets()) if relation else ()
    lengths = {len(a) for a in anchors.values()}
    if lengths != {0} and n == 2 and lengths == {1}:
        anchors = {name: np.repeat(a, 2, 0) for name, a in anchors.items()}
    elif lengths not in ({0}, {n}) or not surfaces:
        if lengths != {0} or surfaces:
            what = "its anchors are incomplete; its points are projected instead"
            said.append(Remark((str(prim.GetPath()),), what, About.PLACE))
        anchors = {}
    return {**anchors, "surfaces": surfaces}


def _one_per_point(path: str, name: str, values: NDArray, counts: tuple[int, ...]) -> NDArray:
    """Spreads a value that is constant, or one per curve, over the points."""
    n = sum(counts)
    if len(values) == 1:
        return np.repeat(values, n, 0)
    if len(values) == n:
        return values
    if len(values) == len(counts):
        return np.repeat(values, counts, 0)
    raise StrokeError(f"stroke {path} has {len(values)} {name} for {n} points: give one, or one per point")


def _write_stroke(scope: Sdf.PrimSpec, stroke: Stroke) -> None:
    spec = scope.nameChildren.get(stroke.name) or Sdf.PrimSpec(
        scope, stroke.name, Sdf.SpecifierDef, "BasisCurves"
    )
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "BasisCurves"
    spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=[API_SCHEMA]))
    if stroke.active:
        spec.ClearActive()
    else:
        spec.active = False
    put = partial(_put, spec)
    uniform = Sdf.VariabilityUniform
    half = stroke.widths[:, None] / 2
    extent = np.stack([(stroke.points - half).min(0), (stroke.points + half).max(0)])
    put("type", Names.Token, "linear", uniform)
    put("wrap", Names.Token, "nonperiodic", uniform)
    put("curveVertexCounts", Names.IntArray, Vt.IntArray(stroke.counts))
    put("points", Names.Point3fArray, _vec3(stroke.points))
    put("extent", Names.Float3Array, _vec3(extent))
    if len(stroke.normals) == len(stroke.points):
        normals = put("normals", Names.Normal3fArray, _vec3(stroke.normals))
        normals.SetInfo("interpolation", "vertex")
    widths = put("widths", Names.FloatArray, Vt.FloatArray(np.float32(stroke.widths).tolist()))
    widths.SetInfo("interpolation", "vertex")
    constant = bool((stroke.colors == stroke.colors[0]).all())
    colors = stroke.colors[:1] if constant else stroke.colors
    color = put("primvars:displayColor", Names.Color3fArray, _vec3(colors))
    color.SetInfo("interpolation", "constant" if constant else "vertex")
    put("purpose", Names.Token, "guide", uniform)
    for name, field in _TOKENS.items():
        put(name, Names.Token, getattr(stroke, field), uniform)
    put("slf:strength", Names.Float, float(stroke.strength), uniform)
    if any(stroke.origin):  # far off, where points of 32 bits are coarse: the prim stands there
        put(ORIGIN, Names.Double3, Gf.Vec3d(*stroke.origin))
        put("xformOpOrder", Names.TokenArray, Vt.TokenArray([ORIGIN]), uniform)
    elif ORIGIN in spec.attributes:
        del spec.attributes[ORIGIN]
        del spec.attributes["xformOpOrder"]
    eye = stroke.eye[:1] if (stroke.eye == stroke.eye[0]).all() else stroke.eye
    put("slf:eye", Names.Point3fArray, _vec3(eye))
    # The order of attributes is that of the file: anchors stand between eye and time.
    surfaces = _write_anchors(spec, stroke)
    put("slf:timeCode", Names.Double, float(stroke.frame), uniform)
    put("slf:choice", Names.String, stroke.choice, uniform)
    _put_where(stroke.tool == "clone", spec, "slf:cloneOffset", stroke.clone_offset)
    _put_where(any(stroke.film_normal), spec, "slf:filmNormal", stroke.film_normal)
    relation = spec.relationships.get("slf:surfaces")
    relation = relation or Sdf.RelationshipSpec(spec, "slf:surfaces", custom=False)
    relation.targetPathList.ClearEditsAndMakeExplicit()
    relation.targetPathList.explicitItems = [Sdf.Path(p) for p in surfaces]


def _write_anchors(spec: Sdf.PrimSpec, stroke: Stroke) -> list[str]:
    """Writes where points lie on surfaces; returns the paths of these."""
    # Copies below a PointInstancer have no path of their own: the prim stands for all of them.
    named = [path.split("[")[0] for path in stroke.surfaces]
    surfaces = list(dict.fromkeys(named))
    index = np.array([surfaces.index(name) for name in named] + [-1], np.int32)[stroke.surface_index]
    _put(spec, "slf:surfaceIndex", Names.IntArray, Vt.IntArray.FromNumpy(index))
    _put(spec, "slf:face", Names.IntArray, Vt.IntArray.FromNumpy(np.ascontiguousarray(stroke.face, np.int32)))
    barycentric = np.ascontiguousarray(stroke.barycentric, np.float32)
    _put(spec, "slf:barycentric", Names.Float2Array, Vt.Vec2fArray.FromNumpy(barycentric))
    return surfaces


def _put_where(is_meant: bool, spec: Sdf.PrimSpec, name: str, vector: tuple[float, float, float]) -> None:
    if is_meant:
        _put(spec, name, Names.Vector3f, Gf.Vec3f(*vector))
    elif name in spec.attributes:
        del spec.properties[name]


def _put(
    spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: Any, variability: Any = Sdf.VariabilityVarying
) -> Sdf.AttributeSpec:
    """Gives an attribute its value; one of another type in the file is replaced."""
    found = spec.attributes.get(name)
    if found and found.typeName != kind:
        del spec.properties[name]
        found = None
    found = found or Sdf.AttributeSpec(spec, name, kind, variability)
    found.default = value
    return found


def _vec3(rows: NDArray) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(rows, np.float32))


def _reordered(layer: Sdf.Layer, parent: Sdf.Path, names: list[str]) -> Sdf.Layer:
    """A copy with the children of `parent` in the order of `names`."""
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.TransferContent(layer)
    with Sdf.ChangeBlock():
        for name in names:
            del copy.GetPrimAtPath(parent).nameChildren[name]
        for name in names:
            Sdf.CopySpec(layer, parent.AppendChild(name), copy, parent.AppendChild(name))
    return copy
