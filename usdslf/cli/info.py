"""What a shot holds, as the program reads it: a table for people, a dictionary for programs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from usdslf.lights.defaults import lights_or_default
from usdslf.runs import distinct
from usdslf.scene.records import Material, MissingTexture, PrimvarInput, Scene, Texture

INPUTS = (
    "diffuse_color", "specular_color", "metallic", "roughness", "ior", "clearcoat", "clearcoat_roughness",
    "emissive_color", "opacity",
)  # fmt: skip
LISTED = 20  # cameras that are named


def describe(scene: Scene) -> dict[str, Any]:
    """Returns JSON-ready values of all that was read."""
    lower, upper = (corner + np.array(scene.origin) for corner in scene.bounds)
    warnings = [*scene.warnings, *filter(None, [lights_or_default(scene)[1]])]
    users = np.zeros(len(scene.materials), np.int64)
    for mesh in scene.meshes:
        users[distinct(mesh.material_of_triangle)] += 1
    return {
        "stage": scene.stage,
        "frame": None if math.isnan(scene.frame) else scene.frame,
        "up_axis": scene.up_axis,
        "meters_per_unit": scene.meters_per_unit,
        "working_space": scene.working_space,
        "bounds": [lower.tolist(), upper.tolist()],
        "meshes": [{"prim": m.path, "triangles": len(m.triangles), "uv_sets": sorted(m.uvs)} for m in scene.meshes],
        "materials": [_describe_material(m, int(n)) for m, n in zip(scene.materials, users)],
        "lights": [{"prim": x.path, "kind": x.kind, "radiance": list(x.radiance)} for x in scene.lights],
        "cameras": [c.path for c in scene.cameras],
        "missing": [vars(m) for m in scene.missing],
        "warnings": warnings,
    }


def _describe_material(material: Material, users: int) -> dict[str, Any]:
    return {
        "prim": material.path,
        "meshes": users,
        "workflow": "specular" if material.use_specular_workflow else "metallic",
        "inputs": {name: _describe_input(getattr(material, name)) for name in INPUTS},
        "normal_map": material.normal.path if material.normal else "",
        "editable": not material.why_not_editable,
        "why_not_editable": material.why_not_editable,
    }


def _describe_input(value: Any) -> Any:
    if isinstance(value, Texture):
        return {"texture": value.path, "channels": value.channels, "uv_set": value.uv_set}
    if isinstance(value, PrimvarInput):
        return {"primvar": value.name}
    values = [round(float(v), 6) for v in np.asarray(value).reshape(-1)]
    return values[0] if len(values) == 1 else values


def as_text(found: dict[str, Any]) -> Iterator[str]:
    """Yields the lines that people read."""
    for m in found["missing"]:
        yield f"missing {' '.join(MissingTexture(**m).sentence.split())}"
    frame = "default time" if found["frame"] is None else f"frame {found['frame']:g}"
    size = np.subtract(found["bounds"][1], found["bounds"][0])
    yield f"{found['stage']}  ({frame})"
    yield (
        f"  {found['up_axis']} up, {found['meters_per_unit']:g} m a unit, "
        f"{' x '.join(f'{s:.4g}' for s in size)} units, working space {found['working_space']}"
    )
    triangles = sum(m["triangles"] for m in found["meshes"])
    yield f"meshes: {len(found['meshes'])} with {triangles} triangles"
    yield f"materials: {len(found['materials'])}"
    lines = []
    for m in found["materials"]:
        state = "" if m["editable"] else f"  not editable: {m['why_not_editable']}"
        inputs = m["inputs"]
        shown = "diffuse_color", "specular_color" if m["workflow"] == "specular" else "metallic", "roughness"
        values = ", ".join(f"{name} {_short(inputs[name])}" for name in shown)
        lines.append((m["prim"] or "(no material)", f": {values}{state}", m["meshes"]))
    for name, text, users in _alike(lines):
        yield f"  {name}  on {users}{text}"
    yield f"lights: {len(found['lights'])}"
    lights = [(x["prim"], f"  {x['kind']}, radiance {_short(x['radiance'])}", 1) for x in found["lights"]]
    yield from (f"  {name}{text}" for name, text, _ in _alike(lights))
    yield f"cameras: {len(found['cameras'])}"
    yield from (f"  {camera}" for camera in found["cameras"][:LISTED])
    if len(found["cameras"]) > LISTED:
        yield f"  and {len(found['cameras']) - LISTED} more"
    yield f"warnings: {len(found['warnings'])}"
    for warning in found["warnings"]:
        yield "  " + " ".join(warning.split())


def _alike(lines: list[tuple[str, str, int]]) -> Iterator[tuple[str, str, int]]:
    """Puts prims of which the same is said together: the first one's name and how many more, text, sum of numbers."""
    alike: dict[str, list[tuple[str, int]]] = {}
    for prim, text, number in lines:
        alike.setdefault(text, []).append((prim, number))
    for text, prims in alike.items():
        more = f" and {len(prims) - 1} more" if len(prims) > 1 else ""
        yield prims[0][0] + more, text, sum(number for _, number in prims)


def _short(value: Any) -> str:
    if isinstance(value, dict):
        key, name = next(iter(value.items()))
        file = str(name).rstrip("]").replace("[", "/").rsplit("/", 1)[-1]  # also in a package, shot.usdz[a.png]
        return f"{key} {file or '(missing)'}"
    values = value if isinstance(value, list) else [value]
    return " ".join(f"{v:.3g}" for v in values)
