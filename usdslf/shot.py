"""Shot: a shot at a frame as it is, and what is computed from it once.

    stage -> Scene -> RayTracer, lights -> Elements, lookup -> Visibility -> fixed light -> LightField

A Shot never changes.  What it has is made when it is first asked for, once, on whichever thread asks; others wait.
Cancelled work leaves what was made before.  Another state (`edited`, `reopened`, `at_frame`) shares what is equal.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.cache import keeps
from usdslf.elements.elements import Elements, refresh_reflectance, sample_elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device, open_device
from usdslf.lazy import Later, Lazy
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import USUAL, check_memory, storage_within
from usdslf.light_field.visibility import Visibility
from usdslf.lights.defaults import lights_or_default
from usdslf.lights.missing_dome import MISSING_DOME, with_missing_domes
from usdslf.lights.sources import LightSet
from usdslf.progress import step, tell_during
from usdslf.quality import quality_of
from usdslf.rays import RayTracer
from usdslf.render.overview_camera import overview_camera
from usdslf.render.settings import LitScene
from usdslf.scene.cameras import camera_of
from usdslf.scene.difference import Afresh, is_same_but_for_reflectance, why_not_comparable
from usdslf.scene.records import Camera, Light, Material, Scene
from usdslf.shot_cache import ShotCache
from usdslf.shot_light import Arriving, Recipe
from usdslf.usd.read.read import open_stage, read_scene

if TYPE_CHECKING:  # as what is imported late: a first picture needs none of it
    from usdslf.animation.frames import PlacedFrame
    from usdslf.animation.revealed import DarkProbes
    from usdslf.inference.gathered import Gathered
    from usdslf.inference.pictured import Pictured
    from usdslf.usd.preview.preview_material import PreviewMaterials


@dataclass(frozen=True, eq=False)
class Shot:
    """A shot at a frame: what `Shot.open` was told, and, made at first use, all that is computed from it.

    Shared between threads as it is.  It holds a thread pool and arrays on the device as long as it lives.

    Attributes:
        source: Usd.Stage as its files have it; never written to.
        stage: Usd.Stage that is read: `source`, with `made` over it.
        made: materials for surfaces without UsdPreviewSurface.
        frame: time code; None: the first frame of an animated shot.
        ocio: OpenColorIO config.
        element_count: surface elements that are asked for.
        bounces: most bounces of the light field.
        refine: levels of subdivision.
        model: preview_surface | phong.
        device_name: number or name of the OpenCL device.
        missing_dome: what shines for a dome whose texture cannot be read: color | white | ignore.
        memory: of the light field on the device, at most [GiB]; None: as much as it takes (light_field/storage.py).
        seconds: of the steps that were taken so far, by step.
        warnings: of those steps, sentences, each once.
        lock: held by the thread that makes something.
        laid: the other frame that the elements were laid at.
        start: light field of another state, where its own starts.

    Source: Nguyen et al. 2013, 5 and 6.
    """

    source: Any
    stage: Any
    made: PreviewMaterials | None = None
    frame: float | None = None
    ocio: str | None = None
    element_count: int = 10000
    bounces: int = 8
    refine: int = 1
    model: str = "preview_surface"
    device_name: str | Device | None = None
    missing_dome: str = MISSING_DOME[0]
    memory: float | None = None
    seconds: dict[str, float] = field(default_factory=dict, repr=False)
    warnings: list[str] = field(default_factory=list, repr=False)
    lock: Any = field(default_factory=threading.RLock, repr=False)
    laid: PlacedFrame | None = field(default=None, repr=False)
    start: list[LightField] = field(default_factory=list, repr=False)

    @staticmethod
    def open(
        stage: Any, frame: float | None = None, device: str | Device | None = None, ocio: str | None = None,
        make_preview: bool = False, **quality: Any,
    ) -> Shot:  # fmt: skip
        """Opens a shot; nothing is read yet.

        Args:
            stage: path or Usd.Stage.
            frame: time code; None: the first frame of an animated shot.
            device, ocio: OpenCL device, by number or name; OpenColorIO config.
            make_preview: surfaces without UsdPreviewSurface get one that shows the same, so that they can be edited.
            quality: `elements` that carry the light field (10000), most `bounces` of it (8), levels `refine` of
                subdivision (1), `model` preview_surface or phong, the paper's, which shows and solves the same inputs
                otherwise, `missing_dome`: what shines for a dome whose texture cannot be read, its own color, white of
                radiance 1, or nothing (ignore), `memory` of the light field on the device, at most [GiB].

        Raises: StageError where the stage cannot be opened, InputError for a number that cannot be.
        """
        elements, bounces, refine, model, missing_dome, memory = quality_of(quality)
        source = open_stage(stage) if isinstance(stage, (str, os.PathLike)) else stage
        made, composed = _with_preview(source, ocio) if make_preview else (None, source)
        asked = elements, bounces, refine, model, device, missing_dome, memory
        return Shot(source, composed, made, frame, ocio, *asked)

    @property
    def path(self) -> str:
        """The file of the shot, or the name of a layer that is in memory alone."""
        return (root := self.source.GetRootLayer()).realPath or root.identifier

    def warn(self, *sentences: str) -> None:
        """Keeps warnings, `sentences`, each once."""
        self.warnings.extend(s for s in dict.fromkeys(sentences) if s not in self.warnings)

    # ── what is made at first use ──────────────────────────────────────────────────────────────

    @Lazy
    def scene(self) -> Scene:
        """The shot as records."""
        with step("read", self.seconds):
            scene = read_scene(self.stage, self.frame, refine=self.refine, ocio=self.ocio)
        self.warn(*scene.warnings, *(self.made.warnings if self.made else ()))
        return with_missing_domes(replace(scene, stage=self.path), self.missing_dome)

    @Lazy
    def device(self) -> Device:
        """The OpenCL device."""
        name = self.device_name
        with step("device", self.seconds):
            return name if isinstance(name, Device) else tell_during(lambda: open_device(name))

    @Lazy
    def later_tracer(self) -> Later[RayTracer]:
        """The same as `tracer`, when it is called."""
        scene, known = self.scene, vars(self).get("tracer")
        return Later.of(known) if known else Later(lambda: RayTracer(scene))

    @Lazy
    def tracer(self) -> RayTracer:
        """Rays against the scene."""
        later = self.later_tracer
        with step("read", self.seconds):
            return tell_during(later)

    @Lazy
    def lights(self) -> tuple[Light, ...]:
        """The shot's lights, or the stated default where it has none."""
        lights, sentence = lights_or_default(self.scene)
        self.warn(*filter(None, [sentence]))
        return lights

    @Lazy
    def light_set(self) -> LightSet:
        """All that shines."""
        lights, scene = self.lights, self.scene
        with step("light", self.seconds):
            return tell_during(lambda: LightSet(scene, lights))

    @Lazy
    def kept(self) -> ShotCache | None:
        """What is kept of it between runs; None where nothing is, or where it goes on from another frame."""
        if self.laid is not None or self.start or not keeps(True):
            return None
        return ShotCache(self.scene, self.lights, self.device, self.element_count)

    @Lazy
    def elements(self) -> Elements:
        """Points on all surfaces.

        Raises: MemoryError_ where their light field does not fit the device, StageError where there is no surface.
        """
        scene, tracer, kept = self.scene, self.later_tracer, self.kept
        check_memory(self.memory, self.element_count, self.device)
        compute = lambda: sample_elements(scene, tracer(), self.element_count, np.random.default_rng(0))  # noqa: E731
        with step("elements", self.seconds):
            return tell_during(lambda: kept.elements(compute) if kept else compute())

    @Lazy
    def lookup(self) -> ElementLookup:
        """Near elements of any point."""
        elements, scene, tracer, kept = self.elements, self.scene, self.later_tracer, self.kept
        compute = lambda: ElementLookup(scene, tracer(), elements)  # noqa: E731
        with step("elements", self.seconds):
            return tell_during(lambda: kept.lookup(elements, compute) if kept else compute())

    @Lazy
    def arriving(self) -> Arriving:
        """What light arrives by, when it is asked for."""
        places, known = (self.elements, self.lookup, self.later_tracer), vars(self).get("visibility")
        return Arriving.of(places, self.lights, self.device, self.kept, known)

    @Lazy
    def visibility(self) -> Visibility:
        """What each element sees in each direction."""
        later = self.arriving.visibility
        with step("visibility", self.seconds):
            return tell_during(later)

    @Lazy
    def dark_probes(self) -> DarkProbes:
        """Places without elements, which other frames ask again for light."""
        from usdslf.animation.revealed import probe_dark

        elements, scene, tracer = self.elements, self.scene, self.tracer
        with step("elements", self.seconds):
            return tell_during(lambda: probe_dark(elements, scene, tracer))

    @Lazy
    def fixed_light(self) -> NDArray[np.float32]:
        """Light (N, D, 3) that no edit changes."""
        later, _ = self.arriving.fixed, self.visibility
        with step("light", self.seconds):
            return tell_during(later)

    @Lazy
    def recipe(self) -> Recipe:
        """What its light field is made of."""
        storage = USUAL
        if self.memory is not None:
            storage = storage_within(self.memory, self.fixed_light, self.elements.emission)
        self.warn(*filter(None, [storage.in_words]))
        return Recipe(self.device, self.elements, self.lookup, self.arriving, self.model, storage, self.bounces)

    @Lazy
    def light_field(self) -> LightField:
        """The surface light field of the shot as it is; others start from it (`LightField.with_surface`)."""
        recipe, kept, start = self.recipe, self.kept, next(iter(self.start), None)
        if not kept or not kept.has_radiance(recipe.elements, recipe.kind):
            self.fixed_light  # noqa: B018  # with its steps
        with step("light field", self.seconds):
            made = tell_during(lambda: recipe.made(kept, start))
        self.start.clear()
        return made

    @Lazy
    def lit(self) -> LitScene:
        """What pictures of it as it is are made of."""
        field, kept, recipe = self.light_field, self.kept, self.recipe
        keep = (lambda compute: kept.sums(recipe.elements, recipe.kind, compute)) if kept else None
        return LitScene(self.scene, self.tracer, field, self.lights, self.device, keep)

    @Lazy
    def pictured(self) -> Pictured:
        """Its light as pictures see it, for evidence."""
        from usdslf.inference.pictured import Pictured

        tracer, field, lights = self.tracer, self.light_field, self.light_set
        with step("evidence", self.seconds):
            return tell_during(lambda: Pictured.of(tracer, field, lights))

    @Lazy
    def gathered(self) -> Gathered:
        """What was traced for strokes on it."""
        from usdslf.inference.gathered import Gathered

        return Gathered()

    @Lazy
    def overview(self) -> Camera:
        """A camera that sees everything."""
        scene, tracer = self.scene, self.tracer
        return tell_during(lambda: overview_camera(scene, tracer))

    def camera(self, path: str | None = None) -> Camera:
        """Returns a camera of the shot, the first one by default, or one that sees everything.

        Raises: StageError where there is none of that path.
        """
        return self.overview if path is None and not self.scene.cameras else camera_of(self.scene, path)

    # ── other states ───────────────────────────────────────────────────────────────────────────

    def edited(self, look: str | os.PathLike[str], follows: bool = False) -> Shot:
        """Returns the shot with a look layer over it; see `reopened`.

        Args:
            look, follows: its file; as of `sharing`.

        Raises: InputError where the look cannot be read.
        """
        from usdslf.usd.edited import open_edited

        return self.reopened(open_edited(self.path, look), follows)

    def under(self, materials: Sequence[Material]) -> Shot:
        """Returns the shot under other `materials`, as many and of the same opacity and glow; light follows."""
        other = self._afresh()
        scene = self.scene.with_materials(materials)
        other._take(scene=scene, tracer=self.tracer.under(scene))
        return self.sharing(other, follows=True)

    def reopened(self, stage: Any, follows: bool = False) -> Shot:
        """Returns another composition of the shot at the same frame; see `sharing`.

        Args:
            stage, follows: a path or a Usd.Stage; as of `sharing`.

        Raises: StageError where the stage cannot be opened.
        """
        return self.sharing(Shot.open(
            stage, self.frame, self.device, self.ocio, self.made is not None, elements=self.element_count,
            bounces=self.bounces, refine=self.refine, model=self.model, missing_dome=self.missing_dome,
            memory=self.memory,
        ), follows)  # fmt: skip

    def sharing(self, other: Shot, follows: bool = False) -> Shot:
        """Gives a state of the shot what is equal there; returns it.

        Where geometry, lights, glow and opacity are as they are, as under our looks, elements, visibility and fixed
        light are shared.

        Args:
            other: of which nothing was made yet.
            follows: its light starts as it is here, and follows where a change is seen (light_field/renewal.py), .1 %
                of all light aside: soon there for who looks at it.
        """
        before, after = self.scene, other.scene
        with step("elements", other.seconds):
            if not tell_during(lambda: is_same_but_for_reflectance(before, after)):
                return other
            own = self.elements
            fresh = tell_during(lambda: refresh_reflectance(own, before, after))
        other._take(
            elements=fresh, lookup=self.lookup, arriving=self.arriving, lights=self.lights
        )
        if follows:
            other.start.append(self.light_field)
        return other

    def relit(self, lights: tuple[Light, ...], elements: int | None = None) -> Shot:
        """Returns the shot in other light; glow stays.

        Args:
            lights, elements: in place of its own; None: as many elements.
        """
        other = self._afresh(element_count=elements or self.element_count)
        other._take(scene=replace(self.scene, lights=lights), tracer=self.tracer)
        return other

    def at_frame(self, frame: float) -> Shot:
        """Returns the shot at another frame, a time code.

        Elements keep the places that they were laid at on what moved, and visibility is traced again only where that
        can have changed it.  What sees light only now gets new elements; other or stretched meshes start afresh, said.
        """
        from usdslf.animation.frames import PlacedFrame, carry

        field = vars(self).get("light_field") or next(iter(self.start), None)
        other = self._afresh(frame=frame, start=[field] if field else [])
        first = self.laid.scene if self.laid else self.scene
        placed: PlacedFrame | Afresh | None = why_not_comparable(first, other.scene)
        if placed is None:
            laid = self.laid or PlacedFrame(self.scene, self.elements, self.lookup, self.visibility, self.dark_probes)
            scene, tracer = other.scene, other.tracer
            with step("visibility", other.seconds):
                placed = tell_during(lambda: carry(laid, scene, tracer, self.device))
        if isinstance(placed, Afresh):
            other.warn(f"frame {frame:g} {placed}: its elements are placed afresh")
            return other
        other._take(laid=laid, elements=placed.elements, lookup=placed.lookup, visibility=placed.visibility)
        if (new := len(placed.elements) - len(laid.elements)) > 0:
            other.warn(f"frame {frame:g}: {new} elements are added where light comes only now")
        return other

    def _afresh(self, **values: Any) -> Shot:
        """Returns another state, on the same device, of which nothing was made yet."""
        own: dict[str, Any] = {"seconds": {}, "warnings": [], "lock": threading.RLock(), "laid": None, "start": []}
        return replace(self, device_name=self.device, **own | values)

    def _take(self, **values: Any) -> None:
        """Takes values of another state, before anybody else knows this one."""
        vars(self).update(values)


def _with_preview(source: Any, ocio: str | None) -> tuple[PreviewMaterials, Any]:
    """Makes the materials that a stage lacks; returns them, and the stage with them over it."""
    from usdslf.usd.border import quiet_usd
    from usdslf.usd.layer.wins import compose_over
    from usdslf.usd.preview.preview_material import make_preview

    made = make_preview(source, ocio)
    with quiet_usd():
        return made, compose_over(source, made.layer)
