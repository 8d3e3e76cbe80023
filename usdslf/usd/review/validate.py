"""What is wrong with the looks and strokes that a stage holds, that USD's own validators do not see.

validate(stage, ocio, scene=None) -> list[Finding(name, prim, message, layer)]     nothing for a stage without any
lines_of_findings(findings) -> list[str]

DanglingOver      an over on what the shot does not have: renamed, removed, or in another variant
DanglingInput     a value of an input that no shader has
HiddenEdit        an opinion or binding that something stronger hides
EditUnderInstance an over below an instance, which USD discards
OutOfRange        a value that a UsdPreviewSurface cannot mean
UnknownColorSpace a colour space that OpenColorIO does not know
MissingTarget     a connection, binding, inherit or painted surface that leads nowhere
MissingFile       a texture that is not there
MissingTexture    the look was solved while a texture of the shot could not be read
AbsolutePath      a path that holds on one machine only
StaleLook         the shot or the strokes changed since the look was solved, or it was solved for another shot
MovedStroke       the surface is not where it was painted; the stroke follows it
BadStroke         a stroke that cannot be meant
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Ar, Sdf, Sdr, Usd, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.errors import StrokeError, UsdslfError
from usdslf.usd.binding import bound_relationship
from usdslf.usd.border import reading
from usdslf.usd.files import assets_of
from usdslf.usd.layer.layer_names import layer_name
from usdslf.usd.layer.provenance import of_another_shot, stale
from usdslf.usd.layer.shown_paths import ShownPaths, is_there
from usdslf.usd.layer.silent import SILENT
from usdslf.usd.layer.wins import why_hidden
from usdslf.usd.look_data import is_look, our_data, texts
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.records import Finding
from usdslf.usd.stroke_layer import SCOPE, read_strokes

if TYPE_CHECKING:
    from usdslf.scene.records import Scene

_UNIT = (0.0, 1.0)
RANGES = {
    "diffuseColor": _UNIT, "specularColor": _UNIT, "metallic": _UNIT, "roughness": _UNIT, "clearcoat": _UNIT,
    "clearcoatRoughness": _UNIT, "opacity": _UNIT, "opacityThreshold": _UNIT, "occlusion": _UNIT,
    "useSpecularWorkflow": _UNIT, "ior": (1.0, np.inf), "emissiveColor": (0.0, np.inf),
}  # fmt: skip
_ABSOLUTE = re.compile(r"^(/|\\|[A-Za-z]:[/\\]|file:)")
_SOURCE_SPACES = ("raw", "sRGB", "auto")


def validate(stage: Usd.Stage, ocio: str | None, scene: Scene | None = None) -> list[Finding]:
    """Returns what is wrong with the look and stroke layers in a stage's own layer stack.

    A look that is opened alone is put over the shot that it names.

    Args:
        ocio: OpenColorIO config that has to know the colour spaces; None is $OCIO, else the built-in one.
        scene: the stage as it was read, if the caller has it: tells whether surfaces moved.
    """
    layers = stage.GetLayerStack(includeSessionLayers=True)
    looks = [x for x in layers if is_look(x)]
    strokes = [x for x in layers if x.defaultPrim == SCOPE and x.realPath]
    findings: list[Finding] = []
    with reading(stage.GetRootLayer().realPath or "the shot"):
        for look in looks:
            over = _with_its_shot(stage, look)
            findings += [*_Look(over, look, color_of(ocio, USD_DEFAULT_SPACE)).findings(), *_of_layer(look)]
        for layer in strokes:
            findings += [*_of_strokes(stage, layer, scene), *_of_layer(layer)]
    return list(dict.fromkeys(findings))


def lines_of_findings(findings: Iterable[Finding]) -> list[str]:
    """Returns the lines that people read."""
    found = list(findings)
    return [f"findings: {len(found)}", *(f"  {f.name}: {f.message}" for f in found)]


def _with_its_shot(stage: Usd.Stage, look: Sdf.Layer) -> Usd.Stage:
    shot = str(our_data(look.customLayerData).get("shot", ""))
    path = look.ComputeAbsolutePath(shot) if shot else ""
    if stage.GetRootLayer() != look or look.subLayerPaths or not os.path.isfile(path):
        return stage
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [look.identifier, path]
    return Usd.Stage.Open(root)


def _of_layer(layer: Sdf.Layer) -> Iterator[Finding]:
    """Paths of a layer that hold on one machine only."""
    file = layer.GetDisplayName()
    paths = [*layer.GetCompositionAssetDependencies(), *assets_of(layer)]
    data = our_data(layer.customLayerData)
    paths += [str(data[name]) for name in ("shot", "strokes") if name in data]
    for path in dict.fromkeys(p for p in paths if _ABSOLUTE.match(p)):
        say = f"{file} names {path}, which other machines do not have: make the path relative."
        yield Finding("AbsolutePath", str(layer.defaultPrim and f"/{layer.defaultPrim}"), say, file)


class _Look:
    """The opinions of one look layer, seen in the stage that they are composed in."""

    def __init__(self, stage: Usd.Stage, layer: Sdf.Layer, color: Color) -> None:
        self.stage, self.layer, self.file = stage, layer, layer_name(stage, layer)
        self.color = color
        self.shown = ShownPaths(stage, layer)
        self.users = self.shown.users

    def findings(self) -> Iterator[Finding]:
        """Yields what is wrong."""
        for phrase in (*stale(self.layer), *of_another_shot(self.layer, self.stage)):
            yield self._finding("StaleLook", "/", f"{self.file} may not fit: {phrase}: solve it again.")
        for missing in texts(our_data(self.layer.customLayerData).get("missing")):
            say = f"{self.file} was solved without a {missing}: restore it and solve again."
            yield self._finding("MissingTexture", "/", say)
        space = our_data(self.layer.customLayerData).get("workingSpace", "")
        if space and not self.color.knows(str(space)):
            yield self._unknown_space(Sdf.Path.absoluteRootPath, str(space))
        for spec in self.layer.rootPrims:
            if spec.name != SILENT:
                yield from self._of_prim(spec)

    def _finding(self, name: str, path: Any, message: str) -> Finding:
        return Finding(name, str(path), message, self.file)

    def _of_prim(self, spec: Sdf.PrimSpec) -> Iterator[Finding]:
        path = self.shown(spec.path)
        prim = self.stage.GetPrimAtPath(path)
        if spec.specifier == Sdf.SpecifierClass and path == spec.path:
            yield self._finding(
                "DanglingOver", path, f"No instance inherits {path} of {self.file}: remove it."
            )
            return
        if path not in self.users and any(base.HasPrefix(path) for base in self.users):
            for child in spec.nameChildren:  # of a scope of classes
                yield from self._of_prim(child)
            return
        if not is_there(self.stage, path):
            say = f"{path} of {self.file} is not in the shot: renamed, removed, or in a variant that is not chosen."
            yield self._finding("DanglingOver", path, say)
            return
        if self._is_discarded(spec.path, path):
            say = f"{path} of {self.file} lies below an instance, where USD discards it: solve again."
            yield self._finding("EditUnderInstance", path, say)
            return
        for kind, paths in (("inherits", spec.inheritPathList), ("specializes", spec.specializesList)):
            for base in paths.GetAddedOrExplicitItems():
                if not self.stage.GetPrimAtPath(self.shown(base)):
                    yield self._missing(path, kind, base)
        for attribute in spec.attributes:
            yield from self._of_attribute(prim, attribute)
        for relationship in spec.relationships:
            yield from self._of_relationship(prim, relationship)
        for child in spec.nameChildren:
            yield from self._of_prim(child)
        for group in spec.variantSets.values():
            chosen = prim.GetVariantSet(group.name).GetVariantSelection()
            if chosen in group.variants:
                yield from self._of_prim(group.variants[chosen].primSpec)

    def _is_discarded(self, written: Sdf.Path, path: Sdf.Path) -> bool:
        """Whether an over is below an instance, but not in the class that this instance inherits."""
        written = written.StripAllVariantSelections()
        home = next((p for p in written.GetPrefixes() if p in self.users), None)
        if written == home:
            return False
        above = [p for p in path.GetPrefixes()[:-1] if self.stage.GetPrimAtPath(p).IsInstance()]
        return bool(above) and above[-1] != (self.shown(home) if home else None)

    def _missing(self, path: Sdf.Path, what: str, target: Sdf.Path) -> Finding:
        say = f"{path} of {self.file} {what} {target}, which is not there: renamed or removed."
        return self._finding("MissingTarget", path, say)

    def _of_attribute(self, prim: Usd.Prim, spec: Sdf.AttributeSpec) -> Iterator[Finding]:
        path = prim.GetPath().AppendProperty(spec.name)
        for target in spec.connectionPathList.GetAddedOrExplicitItems():
            if not self.stage.GetObjectAtPath(self.shown(target)):
                yield self._missing(path, "is connected to", target)
        if self._is_lost_input(prim, spec):
            say = f"{path} of {self.file} is read by nothing: the input was renamed or removed in the shot."
            yield self._finding("DanglingInput", path, say)
        elif spec.HasDefaultValue():
            by, mend = why_hidden(self.stage, self.layer, spec.path, path)
            if by:
                yield self._finding("HiddenEdit", path, f"{path} of {self.file} is hidden by {by}: {mend}.")
        yield from self._of_value(prim, path, spec)

    def _is_lost_input(self, prim: Usd.Prim, spec: Sdf.AttributeSpec) -> bool:
        """Whether the shot knows nothing of an input, neither by a value nor by the shader's definition."""
        port = UsdShade.Input(prim.GetAttribute(spec.name))
        if not port or not spec.HasDefaultValue():
            return False
        stack = port.GetAttr().GetPropertyStack()
        if any(s.layer != self.layer for s in stack):
            return False
        if prim.IsA(UsdShade.NodeGraph):
            return True
        node = Sdr.Registry().GetShaderNodeByIdentifier(UsdShade.Shader(prim).GetIdAttr().Get() or "")
        return bool(node) and port.GetBaseName() not in node.GetShaderInputNames()

    def _of_value(self, prim: Usd.Prim, path: Sdf.Path, spec: Sdf.AttributeSpec) -> Iterator[Finding]:
        value, name = spec.default, spec.name.removeprefix("inputs:")
        spaces = [spec.colorSpace] if spec.HasInfo("colorSpace") else []
        if name == "sourceColorSpace" and value not in _SOURCE_SPACES:
            spaces.append(str(value))
        for space in spaces:
            if not self.color.knows(space):
                yield self._unknown_space(path, space)
        if isinstance(value, Sdf.AssetPath) and not self._is_there(value.path):
            say = f"{path} of {self.file} names {value.path}, which is not there: solve again or restore it."
            yield self._finding("MissingFile", path, say)
        numbers = _numbers(value)
        low, high = -np.inf, np.inf
        if prim.IsA(UsdShade.Shader) and UsdShade.Shader(prim).GetIdAttr().Get() == "UsdPreviewSurface":
            low, high = RANGES.get(name, (low, high))
        if not (np.isfinite(numbers) & (numbers >= low) & (numbers <= high)).all():
            meant = f"{low:g}..{high:g}" if np.isfinite(low) else "finite numbers"
            say = f"{path} of {self.file} is {value}, which is not in {meant}: solve again or correct it."
            yield self._finding("OutOfRange", path, say)

    def _unknown_space(self, path: Sdf.Path, space: str) -> Finding:
        say = f"{path} of {self.file} has the colour space {space}, unknown to {self.color.config_name}: use --ocio."
        return self._finding("UnknownColorSpace", path, say)

    def _is_there(self, asset: str) -> bool:
        if not asset:
            return True
        absolute = self.layer.ComputeAbsolutePath(asset)
        if Ar.IsPackageRelativePath(absolute):
            return bool(Ar.GetResolver().Resolve(absolute))
        path = Path(absolute)
        if "<UDIM>" in path.name:
            return any(path.parent.glob(path.name.replace("<UDIM>", "[0-9][0-9][0-9][0-9]")))
        return os.path.isfile(path)

    def _of_relationship(self, prim: Usd.Prim, spec: Sdf.RelationshipSpec) -> Iterator[Finding]:
        targets = [self.shown(t) for t in spec.targetPathList.GetAddedOrExplicitItems()]
        for target in targets:
            if not self.stage.GetObjectAtPath(target):
                yield self._missing(prim.GetPath().AppendProperty(spec.name), "leads to", target)
            elif spec.name.startswith("material:binding") and "collection" not in spec.name:
                seen = bound_relationship(prim)[0]
                if seen != target:
                    say = f"{prim.GetPath()} shows {seen}, not {target} that {self.file} binds: a stronger binding."
                    yield self._finding("HiddenEdit", prim.GetPath(), say)


def _numbers(value: Any) -> np.ndarray:
    try:
        return np.asarray(value, np.float64).ravel() if value is not None else np.zeros(0)
    except (TypeError, ValueError):  # tokens, strings, files
        return np.zeros(0)


def _of_strokes(stage: Usd.Stage, layer: Sdf.Layer, scene: Scene | None) -> Iterator[Finding]:
    """Strokes that cannot be meant, or whose surfaces are gone or elsewhere."""
    from usdslf.strokes.anchors import locate_stroke

    file = layer.GetDisplayName()
    try:
        strokes = [s for s in read_strokes(layer.realPath) if s.active]
    except StrokeError as error:
        yield Finding("BadStroke", f"/{SCOPE}", str(error), file)
        return
    alone = all(x == layer or x.anonymous for x in stage.GetLayerStack())
    if alone or not strokes:
        return
    for stroke in strokes:
        gone = [p for p in stroke.surfaces if not stage.GetPrimAtPath(p.split("[")[0])]
        for path in gone:
            say = f"{stroke.path} of {file} was painted on {path}, which is not there: paint it again."
            yield Finding("MissingTarget", stroke.path, say, file)
    painted = [s for s in strokes if s.has_anchors]
    frames: dict[str, Scene] = {str(scene.frame): scene} if scene else {}
    for stroke in painted:
        said: list[str] = []
        try:
            key = str(stroke.frame)
            if key not in frames:
                frames[key] = read_scene(stage, None if np.isnan(stroke.frame) else stroke.frame)
            if locate_stroke(frames[key], stroke, said).moved:
                yield Finding("MovedStroke", stroke.path, next(x for x in said if "moved" in x), file)
        except UsdslfError:  # all of its surfaces are gone, which is said above
            continue
