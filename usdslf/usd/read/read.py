"""Read: a stage at one frame -> Scene."""

from __future__ import annotations

import math
import os
import re

import numpy as np
from pxr import Pcp, Sdf, Usd, UsdGeom

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import StageError
from usdslf.replacing import is_folder
from usdslf.runs import distinct
from usdslf.scene.records import Light, Material, Mesh, MissingTexture, PrimvarInput, Scene, Texture
from usdslf.usd.border import parse_reason, reading, text_of
from usdslf.usd.notes import Notes, name_some
from usdslf.usd.read.cameras import read_cameras
from usdslf.usd.read.geometry import read_meshes
from usdslf.usd.read.lights import read_lights
from usdslf.usd.read.materials import MaterialTable
from usdslf.usd.read.origin import scene_origin


def open_stage(path: str | os.PathLike[str]) -> Usd.Stage:
    """Opens a stage with everything loaded.

    Raises:
        StageError: missing, unreadable, or not USD.
    """
    name = os.fspath(path)
    if is_folder(name, StageError):
        raise StageError(f"{name} is a folder, name a .usd, .usda, .usdc or .usdz file in it")
    if os.path.exists(name) and not os.access(name, os.R_OK):
        raise StageError(f"{name} cannot be read, check its rights")
    if not os.path.exists(name) and not Sdf.Layer.Find(name):
        raise StageError(f"{name} does not exist, check the path")
    with reading(name):
        stage = Usd.Stage.Open(name, Usd.Stage.LoadAll)
    if stage is None:
        raise StageError(f"{name} is not a readable USD file, export it again")
    return stage


def time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    """Returns the time at which a stage is read.

    Without a frame it is the stage's startTimeCode where one is authored, else the earliest time, which is
    the default value of what is not animated.  nan, as `Scene.frame` has it, is the same as no frame.
    """
    if frame is not None and not math.isnan(frame):
        return Usd.TimeCode(frame)
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def read_scene(
    stage_or_path: Usd.Stage | str | os.PathLike[str],
    frame: float | None = None,
    refine: int = 1,
    ocio: str | None = None,
) -> Scene:
    """Reads a shot at one frame into numpy records.

    Args:
        stage_or_path: a stage, or a file to open.
        frame: time code; None as `time_code` says.
        refine: levels of subdivision of meshes that ask for it.
        ocio: OpenColorIO config; None is $OCIO, else the built-in one.

    Raises:
        StageError: it cannot be opened, or holds no renderable geometry.
        InputError: the OpenColorIO config cannot be used.
    """
    stage = stage_or_path if isinstance(stage_or_path, Usd.Stage) else open_stage(stage_or_path)
    name = stage.GetRootLayer().realPath or stage.GetRootLayer().identifier
    notes = Notes()
    with reading(name):
        time = time_code(stage, frame)
        color = color_of(ocio, working_space_of(stage))
        warnings = composition_warnings(stage)
        authored = stage.GetRootLayer().pseudoRoot.GetInfo("upAxis")
        if authored and authored not in ("Y", "Z"):
            warnings.append(f"upAxis of {name} is {authored!r}, which is neither Y nor Z: {_up_axis(stage)} is taken")
        origin = scene_origin(stage, time)
        table = MaterialTable(time, color, notes)
        meshes = read_meshes(stage, time, table, refine, warnings, origin)
        lights = read_lights(stage, time, color, notes, origin)
        cameras = read_cameras(stage, time, notes, origin)
    if not any(len(m.triangles) for m in meshes):
        reason = f": {warnings[0]}" if warnings else ""
        raise StageError(f"{name} has no renderable geometry, check visibility, purpose and payloads{reason}")
    meshes, materials = table.used(meshes)
    _note_primvars(meshes, materials, notes)
    return Scene(
        stage=name,
        frame=math.nan if time.IsEarliestTime() or time.IsDefault() else time.GetValue(),
        meshes=tuple(meshes),
        materials=tuple(materials),
        lights=tuple(lights),
        cameras=tuple(cameras),
        up_axis=_up_axis(stage),
        meters_per_unit=UsdGeom.GetStageMetersPerUnit(stage),
        warnings=tuple(dict.fromkeys([*warnings, *notes.sentences()])),
        missing=(*_missing_textures(meshes, materials, notes), *_missing_of_lights(lights, notes)),
        ocio=ocio or "",
        working_space=color.working_space,
        origin=origin,
    )


def _missing_textures(meshes: list[Mesh], materials: list[Material], notes: Notes) -> list[MissingTexture]:
    """The textures of materials that cannot be read, with the fallback that is shown and where."""
    readers: dict[str, tuple[Texture, list[int]]] = {}
    for i, m in enumerate(materials):
        for value in vars(m).values():
            if isinstance(value, Texture) and value.prim in notes.missing:
                readers.setdefault(value.prim, (value, []))[1].append(i)
    found = []
    for prim, (texture, by) in readers.items():
        shown = [m.path for m in meshes if np.isin(m.material_of_triangle, by).any()]
        fallback = ", ".join(f"{texture.fallback['rgba'.index(c)]:g}" for c in texture.channels)
        words = f"its fallback ({fallback}) is shown on {name_some(shown)}"
        found.append(MissingTexture(prim, *notes.missing[prim], words, tuple(materials[i].path for i in by)))
    return found


def _missing_of_lights(lights: list[Light], notes: Notes) -> list[MissingTexture]:
    """The textures of lights that cannot be read."""
    found = []
    for x in (x for x in lights if x.unread):
        radiance = ", ".join(f"{v:.3g}" for v in x.radiance)
        words = f"its colour alone shines, radiance ({radiance})"
        found.append(MissingTexture(x.path, *notes.missing[x.path], words))
    return found


def _up_axis(stage: Usd.Stage) -> str:
    axis = str(UsdGeom.GetStageUpAxis(stage))
    return axis if axis in ("Y", "Z") else "Y"


def working_space_of(stage: Usd.Stage) -> str:
    """Returns the rendering colour space of the stage's render settings, else USD's default."""
    path = stage.GetMetadata("renderSettingsPrimPath") if stage.HasMetadata("renderSettingsPrimPath") else ""
    settings = stage.GetPrimAtPath(path) if path else None
    attribute = settings.GetAttribute("renderingColorSpace") if settings else None
    return str((attribute.Get() if attribute else None) or USD_DEFAULT_SPACE)


def composition_warnings(stage: Usd.Stage) -> list[str]:
    """Returns a sentence for each kind of composition error of a stage, naming prims and files."""
    files_of: dict[tuple[str, str], dict[str, None]] = {}
    prims_of: dict[tuple[str, str], dict[str, None]] = {}
    other: dict[type, list[str]] = {}
    # USD composes on several threads: its order of errors is chance.
    for error in sorted(stage.GetCompositionErrors(), key=text_of):
        text = re.sub(r":SDF_FORMAT_ARGS:[^@]*", "", " ".join(text_of(error).split()).rstrip("."))
        site = getattr(error, "rootSite", None)
        prim = str(site.path) if isinstance(site, Pcp.Site) else ""
        unopened = re.match(r"Could not open asset @(.*?)@ for (\S+)(?:.* -- (.*))?", text)
        if unopened:
            kind = unopened[2], _why_not_opened(unopened[1], unopened[3] or "")
            files_of.setdefault(kind, {})[os.path.basename(unopened[1])] = None
            prims_of.setdefault(kind, {})[prim] = None
        else:
            other.setdefault(type(error), []).append(text if prim in ("", "/") else f"{prim}: {text}")
    sentences = [
        f"{name_some(list(files))}, {kind[0]} of {name_some(list(prims_of[kind]))}, cannot be opened: {kind[1]}"
        for kind, files in files_of.items()
    ]
    for texts in other.values():
        more = f" (and {len(texts) - 1} more like it)" if len(texts) > 1 else ""
        sentences.append(texts[0] + more)
    return list(dict.fromkeys(sentences))


def _why_not_opened(path: str, reason: str) -> str:
    if path.endswith(".mtlx"):
        return "this build of USD does not read MaterialX"
    if not reason or not os.path.exists(path):
        return "there is no such file"
    return reason.split(" @")[0] if "file format" in reason else parse_reason(reason)


def _note_primvars(meshes: list[Mesh], materials: list[Material], notes: Notes) -> None:
    """Notes gprims without a primvar that their material reads, or with one that leaves its texture."""
    values = [[v for v in vars(m).values() if isinstance(v, Texture | PrimvarInput)] for m in materials]
    for mesh in meshes:
        for m in distinct(mesh.material_of_triangle):
            for value in values[m]:
                if isinstance(value, PrimvarInput):
                    if value.name not in mesh.primvars:
                        reason = f"no primvar {value.name} on {{}}: the reader's fallback is used"
                        notes.add(reason, mesh.path)
                elif any(any(row[:2]) for row in value.st_from_uv[:2]):  # else st is constant
                    _note_coordinates(mesh, value, notes)


def _note_coordinates(mesh: Mesh, texture: Texture, notes: Notes) -> None:
    """Notes missing texture coordinates, and those that leave a texture that is black outside."""
    uv = mesh.coordinates(texture.uv_set)
    if uv is None:
        has = f" (it has {', '.join(sorted(mesh.uvs))})" if mesh.uvs else ""
        notes.add(f"no texture coordinates {texture.uv_set} on {{}}{has}: its textures show one texel", mesh.path)
        return
    black = [wrap == "black" and not texture.tiles for wrap in (texture.wrap_s, texture.wrap_t)]
    if not any(black) or not len(uv):
        return
    m = np.asarray(texture.st_from_uv)
    st = (uv.reshape(-1, 2) @ m[:2, :2].T + m[:2, 2])[:, black]
    if st.min() < -0.01 or st.max() > 1.01:
        reason = f"texture coordinates {texture.uv_set} of {{}} leave 0..1, where its textures are black"
        notes.add(f"{reason} (no wrap mode is authored)", mesh.path)
