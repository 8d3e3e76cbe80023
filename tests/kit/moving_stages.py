"""Small stages in which something moves between two frames."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from kit.stage_parts import MeshData, StageBuilder, Triple, ball, box, rectangle
from pxr import Gf, Sdf, UsdGeom, UsdLux, UsdSkel

FRAMES = (1.0, 5.0)


def roll(folder: Path, opacity: float = 1.0, veil: bool = False) -> Path:
    """A ball that rolls over a table past a box, turning, at frames 1 to 5; a lamp, a dome."""
    b = StageBuilder(folder)
    wood = b.material("wood", diffuseColor=(0.5, 0.4, 0.3), roughness=0.7)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), wood)
    b.mesh("box", box(0.3, 0.4, 0.3), wood, (0.35, 0, -0.3), 20.0)
    red = b.material("red", diffuseColor=(0.5, 0.1, 0.1), roughness=0.4, opacity=opacity)
    b.mesh("ball", ball(0.2), red)
    if veil:
        gauze = b.material("gauze", diffuseColor=(0.7, 0.7, 0.7), opacity=0.5)
        b.mesh("veil", rectangle((-0.6, 0.02, 0.0), (0.9, 0, 0), (0, 0.5, 0)), gauze)
    move(b, "ball", (-0.5, 0, 0.25), (0.1, 0, 0.25), turn=5.0)
    return finish(b)


def move(b: StageBuilder, name: str, first: Triple, last: Triple, turn: float = 0.0) -> None:
    """Gives a prim places at the two frames, and a turn about y by degrees a frame."""
    prim = UsdGeom.Xformable(b.stage.GetPrimAtPath(f"/World/{name}"))
    prim.ClearXformOpOrder()
    place = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble, "roll")
    rotate = prim.AddRotateYOp(UsdGeom.XformOp.PrecisionFloat, "turn")
    for frame, at in zip(FRAMES, (first, last), strict=True):
        place.Set(Gf.Vec3d(*at), frame)
        rotate.Set(turn * frame, frame)


def finish(b: StageBuilder, lights: bool = True) -> Path:
    """Adds a lamp, a dome and a camera, and the range of frames."""
    if lights:
        light = UsdLux.SphereLight.Define(b.stage, "/World/lamp")
        light.CreateRadiusAttr(0.2)
        light.CreateIntensityAttr(30.0)
        light.AddTranslateOp().Set(Gf.Vec3d(-0.6, 1.5, 0.8))
        b.dome_light("sky", 0.3, (1, 1, 1))
    b.camera((0.0, 1.2, 2.0), (0.0, 0.1, 0.0))
    b.stage.SetStartTimeCode(FRAMES[0])
    b.stage.SetEndTimeCode(FRAMES[1])
    return b.save()


def glass(folder: Path) -> Path:
    """The ball of `roll`, half seen through."""
    return roll(folder, opacity=0.5)


def behind_a_veil(folder: Path) -> Path:
    """The ball of `roll`, rolling behind a gauze that stands still."""
    return roll(folder, veil=True)


def glass_behind_a_veil(folder: Path) -> Path:
    """Both."""
    return roll(folder, opacity=0.5, veil=True)


def crowd(folder: Path) -> Path:
    """Forty balls of which twenty move: more than are told apart."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    for i in range(40):
        x, z = -0.9 + 0.25 * (i % 8), -0.6 + 0.3 * (i // 8)
        b.mesh(f"ball{i}", ball(0.05, 8), grey)
        move(b, f"ball{i}", (x, 0, z), (x, 0.3 * (i % 2), z))
    return finish(b)


def instances(folder: Path) -> Path:
    """Two instances of an asset, one of which moves."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    b.mesh("asset/body", box(0.3, 0.3, 0.3), grey)
    b.stage.GetPrimAtPath("/World/asset").SetSpecifier(Sdf.SpecifierClass)
    for name, first, last in (("still", (0.5, 0, 0), (0.5, 0, 0)), ("mover", (-0.5, 0, 0), (-0.1, 0, 0.4))):
        prim = UsdGeom.Xform.Define(b.stage, f"/World/{name}").GetPrim()
        prim.GetReferences().AddInternalReference("/World/asset")
        prim.SetInstanceable(True)
        move(b, name, first, last, turn=7.0 if name == "mover" else 0.0)
    return finish(b)


def copies(folder: Path) -> Path:
    """Three copies by a PointInstancer, one of which moves and turns."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    many = UsdGeom.PointInstancer.Define(b.stage, "/World/many")
    b.mesh("many/box", box(0.25, 0.3, 0.25), grey)
    many.CreatePrototypesRel().SetTargets(["/World/many/box"])
    many.CreateProtoIndicesAttr([0, 0, 0])
    places = [(-0.6, 0, 0), (0, 0, 0), (0.6, 0, 0.1)]
    half = Gf.Quath(math.cos(0.3), 0, math.sin(0.3), 0)
    still = Gf.Quath(1, 0, 0, 0)
    many.CreatePositionsAttr().Set([Gf.Vec3f(*p) for p in places], FRAMES[0])
    many.GetPositionsAttr().Set([Gf.Vec3f(*p) for p in [*places[:2], (0.3, 0.1, 0.5)]], FRAMES[1])
    many.CreateOrientationsAttr().Set([still] * 3, FRAMES[0])
    many.GetOrientationsAttr().Set([still, still, half], FRAMES[1])
    return finish(b)


def skinned(folder: Path) -> Path:
    """A post whose upper part follows a joint that turns by 60 degrees."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    stage = b.stage
    UsdSkel.Root.Define(stage, "/World/post")
    skeleton = UsdSkel.Skeleton.Define(stage, "/World/post/skel")
    joints = ["low", "low/high"]
    bind = [Gf.Matrix4d(1), Gf.Matrix4d().SetTranslate((0, 0.4, 0))]
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateBindTransformsAttr(bind)
    skeleton.CreateRestTransformsAttr(bind)
    animation = UsdSkel.Animation.Define(stage, "/World/post/skel/anim")
    animation.CreateJointsAttr(joints)
    animation.CreateTranslationsAttr([(0, 0, 0), (0, 0.4, 0)])
    animation.CreateScalesAttr([(1, 1, 1)] * 2)
    still = Gf.Quatf(1, 0, 0, 0)
    turned = Gf.Quatf(math.cos(math.pi / 6), 0, 0, math.sin(math.pi / 6))
    animation.CreateRotationsAttr().Set([still, still], FRAMES[0])
    animation.GetRotationsAttr().Set([still, turned], FRAMES[1])
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/World/post/skel/anim"])
    b.mesh("post/body", _post(), grey)
    mesh = stage.GetPrimAtPath("/World/post/body")
    height = np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get())[:, 1]
    binding = UsdSkel.BindingAPI.Apply(mesh)
    binding.CreateSkeletonRel().SetTargets(["/World/post/skel"])
    binding.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * len(height))
    upper = np.clip((height - 0.3) / 0.2, 0, 1)
    binding.CreateJointWeightsPrimvar(False, 2).Set(np.stack([1 - upper, upper], 1).ravel().tolist())
    return finish(b)


def _post() -> MeshData:
    """Four walls of six stories."""
    ring = np.array([(-0.1, -0.1), (-0.1, 0.1), (0.1, 0.1), (0.1, -0.1)])
    stories = np.linspace(0, 0.8, 7)
    points = np.array([(x, y, z) for y in stories for x, z in ring])
    faces = [
        (4 * s + i, 4 * s + (i + 1) % 4, 4 * s + 4 + (i + 1) % 4, 4 * s + 4 + i) for s in range(6) for i in range(4)
    ]
    return MeshData(points, np.full(len(faces), 4), np.array(faces).ravel(), None, None)


def flip_book(folder: Path) -> Path:
    """A mesh that is cut into other faces at the last frame."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    path = b.mesh("page", box(0.3, 0.3, 0.3), grey)
    mesh = UsdGeom.Mesh(b.stage.GetPrimAtPath(path))
    for frame, data in zip(FRAMES, (box(0.3, 0.3, 0.3), ball(0.2, 8)), strict=True):
        mesh.GetPointsAttr().Set(data.positions.astype(np.float32), frame)
        mesh.GetFaceVertexCountsAttr().Set(data.counts.astype(np.int32), frame)
        mesh.GetFaceVertexIndicesAttr().Set(data.indices.astype(np.int32), frame)
    b.stage.RemovePrim(path + ".primvars:st")
    mesh.GetPrim().RemoveProperty("primvars:st")
    return finish(b)


def chest(folder: Path) -> Path:
    """A chest with black walls and a grey floor whose lid is shut, and far away at the last frame; a white dome alone.

    The floor is 2 x 2, the walls are 1 high.
    """
    b = _chest(folder, 2.4)
    move(b, "lid", (0, 0, 0), (0, -500, 0))
    b.dome_light("sky", 1.0)
    return finish(b, lights=False)


def lamp_in_a_chest(folder: Path) -> Path:
    """The chest, shut, with a lamp far above it that is in its middle at the last frame; nothing else moves."""
    b = _chest(folder, 2.4)
    light = UsdLux.SphereLight.Define(b.stage, "/World/lamp")
    light.CreateRadiusAttr(0.1)
    light.CreateIntensityAttr(30.0)
    place = light.AddTranslateOp()
    place.Set(Gf.Vec3d(0, 5, 0), FRAMES[0])
    place.Set(Gf.Vec3d(0, 0.5, 0), FRAMES[1])
    return finish(b, lights=False)


def slit(folder: Path) -> Path:
    """The chest with a lid that is a little short, so that some paths out of it find the sky; a ball moves above."""
    b = _chest(folder, 2.12)
    b.mesh("ball", ball(0.2), diffuse(b, "grey", 0.5))
    move(b, "ball", (-1, 2, 0), (1, 2, 0))
    b.dome_light("sky", 1.0)
    return finish(b, lights=False)


def _chest(folder: Path, lid: float) -> StageBuilder:
    b = StageBuilder(folder)
    floor, black = diffuse(b, "floor", 0.5), diffuse(b, "black", 0.0)
    b.mesh("floor", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), floor)
    for name, corner, along in (
        ("a", (-1, 0, -1), (2, 0, 0)),
        ("b", (1, 0, -1), (0, 0, 2)),
        ("c", (1, 0, 1), (-2, 0, 0)),
        ("d", (-1, 0, 1), (0, 0, -2)),
    ):
        b.mesh(name, rectangle(corner, (0, 1, 0), along), black)
    b.mesh("lid", rectangle((-1.2, 1, 1.2), (lid, 0, 0), (0, 0, -2.4)), black)
    return b


def slab(folder: Path) -> Path:
    """A dark slab that lies on the middle of a grey table, and is far below at the last frame; a white dome alone."""
    b = StageBuilder(folder)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), diffuse(b, "grey", 0.5))
    b.mesh("slab", box(0.8, 0.1, 0.8), diffuse(b, "black", 0.0))
    move(b, "slab", (0, 0, 0), (0, -500, 0))
    b.dome_light("sky", 1.0)
    return finish(b, lights=False)


def wall(folder: Path) -> Path:
    """A thin wall that stands on a table and moves to another place of it."""
    b = StageBuilder(folder)
    grey = b.material("grey", diffuseColor=(0.5, 0.5, 0.5), roughness=0.6)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), grey)
    b.mesh("wall", rectangle((0, 0, 0.8), (0, 0, -1.6), (0, 0.5, 0)), grey)
    move(b, "wall", (-0.4, 0, 0), (0.4, 0, 0))
    return finish(b)


def plates(first: float, last: float) -> Callable[[Path], Path]:
    """Two squares one apart, the lower one alight, whose sides grow; nothing else shines."""

    def build(folder: Path) -> Path:
        b = StageBuilder(folder)
        b.mesh("low", rectangle((-0.5, 0, 0.5), (1, 0, 0), (0, 0, -1)), diffuse(b, "lit", 0.5, 1.0))
        b.mesh("high", rectangle((-0.5, 1, -0.5), (1, 0, 0), (0, 0, 1)), diffuse(b, "pale", 0.8))
        for name in ("low", "high"):
            scale = UsdGeom.Xformable(b.stage.GetPrimAtPath(f"/World/{name}")).AddScaleOp()
            for frame, side in zip(FRAMES, (first, last), strict=True):
                scale.Set(Gf.Vec3f(side, 1, side), frame)
        return finish(b, lights=False)

    return build


def diffuse(b: StageBuilder, name: str, reflectance: float, emission: float = 0.0) -> str:
    """A material without any specular reflection."""
    return b.material(
        name,
        useSpecularWorkflow=1,
        specularColor=(0.0, 0.0, 0.0),
        diffuseColor=(reflectance,) * 3,
        emissiveColor=(emission,) * 3,
        roughness=1.0,
    )
