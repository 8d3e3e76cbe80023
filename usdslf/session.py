"""Session: the whole flow on one page.  Keeps each step's result and drops what a change makes stale.

    stage -> Scene -> Elements -> Visibility -> LightField -> (strokes) -> Answers -> look layer, pictures
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import usdslf
from usdslf.animation.frames import Placed, carry
from usdslf.animation.revealed import DarkProbes, probe_dark
from usdslf.color import Color, color_of
from usdslf.edits.edits import MaterialChange
from usdslf.edits.read_back import why_missing
from usdslf.elements.elements import Elements, refresh_reflectance, sample_elements
from usdslf.elements.lookup import ElementLookup
from usdslf.errors import AuthorError, InputError, SolveError, StageError, StrokeError
from usdslf.gpu.device import Device, open_device
from usdslf.inference.answer_residuals import residual_as_preview, residual_as_written
from usdslf.inference.answers import Answer, Painted, Pool
from usdslf.inference.asked import asked_of
from usdslf.inference.changes import changes_of, with_varying
from usdslf.inference.direct import gather_strokes, infer_changes
from usdslf.inference.indirect import infer_indirect
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField, Surface, require_memory
from usdslf.light_field.static_light import static_light
from usdslf.light_field.visibility import Visibility, trace_visibility
from usdslf.lights.defaults import lights_or_default
from usdslf.lights.sources import LightSet
from usdslf.rays import RayTracer
from usdslf.render.overview_camera import overview_camera
from usdslf.render.picture import LitScene, PictureOptions, render
from usdslf.report import report_of
from usdslf.scene.difference import why_not_comparable
from usdslf.scene.records import Camera, Light, Scene
from usdslf.similarity.materials import painted_places, similarity_picture
from usdslf.similarity.similarity import Weights
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.changes import restyled, with_styles
from usdslf.stylize.surroundings import find_surroundings
from usdslf.stylize.unsharp_mask import (
    AMOUNT,
    RADIUS,
    Stylized,
    check_numbers,
    check_surroundings,
    editable_materials,
    stylize_light,
)
from usdslf.surfaces.reflectance import model_of
from usdslf.usd.author.author import author_look, author_review_root, check_look_place
from usdslf.usd.author.read_back import kept_unless_whole, scene_under
from usdslf.usd.border import quiet_usd
from usdslf.usd.edited import open_edited
from usdslf.usd.layer.baked_files import textures_folder
from usdslf.usd.layer.wins import AuthoredEdit, compose_over
from usdslf.usd.preview.preview_material import make_preview as make_preview_materials
from usdslf.usd.read.read import open_stage, read_scene

MUCH_WORSE = 1.5  # times the residual, where a look falls short of what was found
Say = Callable[[str, float], None]
"""Told the name of a step and how much of it is done, 0..1."""


class Session:
    """A shot, its light field, the strokes on it and what they ask for."""

    def __init__(
        self,
        stage: Any,
        frame: float | None = None,
        device: str | Device | None = None,
        ocio: str | None = None,
        elements: int = 10000,
        bounces: int = 8,
        refine: int = 1,
        model: str = "preview_surface",
        say: Say | None = None,
        make_preview: bool = False,
    ) -> None:
        """Opens the stage; steps run when they are first needed.

        Args:
            stage: path or Usd.Stage.  It is never written to.
            frame: time code; None: the first frame of an animated shot.
            device: OpenCL device, by number or name.
            ocio: OpenColorIO config.
            elements: how many surface elements carry the light field.
            bounces: most bounces of the light field.
            refine: levels of subdivision.
            model: preview_surface, or phong, the paper's, which shows and solves the same inputs otherwise.
            make_preview: surfaces without UsdPreviewSurface get one that shows the same, so that they can be edited.

        Raises: StageError where the stage cannot be opened.
        """
        if elements < 1 or elements >= 1 << 22:
            raise InputError(f"--elements {elements} is not in 1 .. {(1 << 22) - 1}")
        if bounces < 1:
            raise InputError(f"--bounces {bounces} is less than 1")
        model_of(model)
        self.shot = open_stage(stage) if isinstance(stage, (str, os.PathLike)) else stage
        self.made = make_preview_materials(self.shot, ocio) if make_preview else None
        with quiet_usd():
            self.stage = compose_over(self.shot, self.made.layer) if self.made else self.shot
        self.frame, self.ocio = frame, ocio
        self.element_count, self.bounces, self.refine, self.model = elements, bounces, refine, model
        self._device_name = device
        self._say = say or (lambda step, share: None)
        self.seconds: dict[str, float] = {}
        self.warnings: list[str] = []
        self.strokes: list[Stroke] = []
        self.answers: list[Answer] = []
        self.stylized: Stylized | None = None
        self._solved_with = ""  # norm and weights, where they are not the default
        self._painted: list[Painted] = []  # what the last solve looked at
        self.residual_as_written: dict[Pool, float] = {}  # of answers that vary, as the written look shows them
        self.residual_as_preview: dict[Pool, float] = {}  # of answers by phong, as UsdPreviewSurface shows them
        self.edits: list[AuthoredEdit] = []
        self._laid: Placed | None = None  # the other frame that the elements were laid at
        self._last_field: LightField | None = None  # of another frame: where iterations start

    # ── steps ──────────────────────────────────────────────────────────────────────────────────

    @contextmanager
    def _step(self, name: str) -> Iterator[None]:
        self._say(name, 0.0)
        began, within = time.perf_counter(), sum(self.seconds.values())
        yield
        inner = sum(self.seconds.values()) - within
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - began - inner
        self._say(name, 1.0)

    @cached_property
    def scene(self) -> Scene:
        """The shot as records."""
        with self._step("read"):
            scene = read_scene(self.stage, self.frame, refine=self.refine, ocio=self.ocio)
            root = self.shot.GetRootLayer()
            scene = replace(scene, stage=root.realPath or root.identifier)
        self.warn(*scene.warnings, *(self.made.warnings if self.made else ()))
        return scene

    @cached_property
    def device(self) -> Device:
        """The OpenCL device."""
        return self._device_name if isinstance(self._device_name, Device) else open_device(self._device_name)

    @cached_property
    def tracer(self) -> RayTracer:
        """Rays against the scene."""
        with self._step("read"):
            return RayTracer(self.scene)

    @cached_property
    def lights(self) -> tuple[Light, ...]:
        """The shot's lights, or the stated default where it has none."""
        lights, sentence = lights_or_default(self.scene)
        self.warn(*filter(None, [sentence]))
        return lights

    @cached_property
    def light_set(self) -> LightSet:
        """All that shines."""
        lights, scene = self.lights, self.scene
        with self._step("light"):
            return LightSet(scene, lights)

    @cached_property
    def elements(self) -> Elements:
        """Points on all surfaces.

        Raises: MemoryError_ where their light field does not fit the device.
        """
        scene, tracer = self.scene, self.tracer
        require_memory(self.device, self.element_count)
        with self._step("elements"):
            return sample_elements(scene, tracer, self.element_count, np.random.default_rng(0))

    @cached_property
    def lookup(self) -> ElementLookup:
        """Near elements of any point."""
        elements = self.elements
        with self._step("elements"):
            return ElementLookup(self.scene, self.tracer, elements)

    @cached_property
    def visibility(self) -> Visibility:
        """What each element sees in each direction."""
        lookup, device = self.lookup, self.device
        with self._step("visibility"):
            return trace_visibility(self.elements, lookup, self.tracer, device)

    @cached_property
    def dark_probes(self) -> DarkProbes:
        """Places without elements, which other frames ask again for light."""
        with self._step("elements"):
            return probe_dark(self.elements, self.scene, self.tracer)

    @cached_property
    def fixed_light(self) -> NDArray[np.float32]:
        """Light (N, D, 3) that no edit changes."""
        visibility, lights = self.visibility, self.lights
        with self._step("light"):
            return static_light(self.elements, self.tracer, lights, visibility).diffuse

    @cached_property
    def light_field(self) -> LightField:
        """The surface light field of the shot as it is."""
        fixed, visibility = self.fixed_light, self.visibility
        with self._step("light field"):
            field = LightField(
                self.device, self.elements, self.lookup, visibility, fixed, self.scene.triangles.face_normals,
                self.model,
            )  # fmt: skip
            if self._last_field is not None:
                field.start_from(self._last_field)
                self._last_field = None
            self._converge(field)
        return field

    def _converge(self, field: LightField) -> None:
        for number, _ in enumerate(field.converge(self.bounces)):
            self._say("light field", (number + 1) / self.bounces)

    # ── strokes ────────────────────────────────────────────────────────────────────────────────

    def add_stroke(self, stroke: Stroke) -> None:
        """Adds a stroke, or replaces the one of the same name.

        Raises: StrokeError for numbers that are not finite.
        """
        if not all(np.isfinite(x).all() for x in (stroke.points, stroke.widths, stroke.colors, stroke.eye)):
            raise StrokeError(f"{stroke.path} has points, widths, colours or eyes that are not finite; paint it again")
        self.strokes = [s for s in self.strokes if s.name != stroke.name] + [stroke]
        self.answers, self.edits = [], []

    def remove_stroke(self, name: str) -> None:
        """Takes a stroke away."""
        self.strokes = [s for s in self.strokes if s.name != name]
        self.answers, self.edits = [], []

    def solve(
        self, norm: str | None = None, choose: Mapping[str, str] | None = None, options: Options | None = None,
        similarity: Weights | None = None,
    ) -> list[Answer]:  # fmt: skip
        """Finds the smallest change of materials that explains the strokes.

        Args:
            norm: l2 | l0 | mixed for all strokes; None: each stroke's own.
            choose: stroke name -> id of an alternative.
            options: weights of the choice, `Options.of((1, 5, 25))` or `Options.of({"group": 8})`.
            similarity: weights of what strokes of scope `similar` change beside the painted material.

        Raises: StrokeError, SolveError.
        """
        self.stylized = None
        active = [s for s in self.strokes if s.active]
        if not active:
            raise SolveError("there is no active stroke; paint one with: usdslf stroke")
        if norm:
            active = [replace(s, norm=norm) for s in active]
        lights = self.light_set
        said = [f"norm {norm}" if norm else "", options.in_words() if options else ""]
        self._solved_with, self.residual_as_preview = ", ".join(filter(None, said)), {}
        self.edits, self.residual_as_written = [], {}
        with self._kept_field() as field:
            with self._step("evidence"):
                painted = gather_strokes(active, self.scene, self.tracer, field, lights, self.warnings)
                self._painted = painted
            with self._step("solve"):
                direct: list[Answer] = []
                if any(p.stroke.mode == "direct" for p in painted):
                    rounds = infer_changes(
                        painted, self.scene, field, options, dict(choose or {}), self.bounces, self.warnings,
                        similarity,
                    )  # fmt: skip
                    for number, direct in enumerate(rounds):  # noqa: B007
                        self._say("solve", (number + 1) / 4)
                self.answers = direct
                if not model_of(self.model).is_authored:
                    self.residual_as_preview = {a.pool: residual_as_preview(a, painted, field) for a in direct}
                if any(p.stroke.mode == "indirect" for p in painted):
                    self.answers = direct + infer_indirect(
                        painted, self.scene, field, options, self.bounces, self.warnings, dict(choose or {}), direct
                    )
        for a in self.answers:
            if a.is_ambiguous and not a.others:
                names = ", ".join(active[i].path for i in a.pool.strokes)
                other = next(c.id for c in a.candidates if c.id != a.chosen.id)
                self.warn(f"{names}: {a.chosen.id} and {other} explain it about equally well; paint more or choose")
        return self.answers

    def stylize(self, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed") -> Stylized:
        """Unsharp masks the light field of the whole shot, and finds the reflectance that explains it.

        What `solve` found is dropped: the look is one of the shot as it is.

        Args:
            amount: contrast that is added, as a multiple of what is there; 0 changes nothing.
            radius: of the surroundings that a place is set off from, as a share of the scene's diagonal.
            norm: l0 | mixed | l2: how freely diffuse, specular and glossiness of a place change together.

        Raises: InputError for numbers that cannot be, AuthorError where no material can be edited.
        """
        check_numbers(amount, radius)
        shown = [int(m) for m in np.unique(self.scene.triangles.material)]
        free = editable_materials(self.scene, shown, self.warnings)
        self.answers, self.edits = [], []
        with self._kept_field() as field, self._step("stylize"):
            near = find_surroundings(self.elements, self.tracer, radius * self.scene.diagonal)
            check_surroundings(near, self.scene)
            rounds = stylize_light(field, near, amount, radius, free, self.bounces, norm)
            for number, found in enumerate(rounds):  # noqa: B007
                self._say("stylize", (number + 1) / 2)
        self.stylized = found
        return found

    def edited(self, look: str | os.PathLike[str]) -> Session:
        """Returns a session on the shot with a look layer over it; see `reopened`.

        Raises: InputError where the look cannot be read.
        """
        return self.reopened(open_edited(self.shot.GetRootLayer().realPath, look))

    def reopened(self, stage: Any) -> Session:
        """Returns a session on another composition of the shot, a path or a Usd.Stage.

        Where that leaves all geometry as it is, as our looks do, elements, visibility and fixed light are shared.

        Raises: StageError where the stage cannot be opened.
        """
        other = Session(
            stage, self.frame, self.device, self.ocio, self.element_count, self.bounces, self.refine, self.model,
            self._say, self.made is not None,
        )  # fmt: skip
        if np.array_equal(other.scene.triangles.positions, self.scene.triangles.positions):
            shared = {
                "elements": refresh_reflectance(self.elements, self.scene, other.scene),
                "lookup": self.lookup,
                "visibility": self.visibility,
                "fixed_light": self.fixed_light,
                "lights": self.lights,
            }
            other.__dict__.update(shared)
        return other

    def at_frame(self, frame: float) -> Session:
        """Returns a session on the shot at another frame; strokes are taken along and follow their anchors.

        Elements keep the places that they were laid at on what moved, whatever frames came between, and visibility is
        traced again only where that can have changed it.  Surfaces that see light only now get new elements.  Where
        the frame has other meshes, or stretches them much, all starts afresh, and that is said.
        """
        other = Session(
            self.stage, frame, self.device, self.ocio, self.element_count, self.bounces, self.refine, self.model,
            self._say, self.made is not None,
        )  # fmt: skip
        other.strokes = list(self.strokes)
        other._last_field = self.__dict__.get("light_field") or self._last_field
        placed: Placed | str = why_not_comparable(self._laid.scene if self._laid else self.scene, other.scene)
        if not placed:
            laid = self._laid or Placed(self.scene, self.elements, self.lookup, self.visibility, self.dark_probes)
            with other._step("visibility"):
                placed = carry(laid, other.scene, other.tracer, self.device)
        if isinstance(placed, str):
            other.warn(f"frame {frame:g} {placed}: its elements are placed afresh")
            return other
        other._laid = laid
        other.__dict__.update(elements=placed.elements, lookup=placed.lookup, visibility=placed.visibility)
        if len(placed.elements) > len(laid.elements):
            new = len(placed.elements) - len(laid.elements)
            other.warn(f"frame {frame:g}: {new} elements are added where light comes only now")
        return other

    # ── results ────────────────────────────────────────────────────────────────────────────────

    def camera(self, path: str | None = None) -> Camera:
        """Returns a camera of the shot, the first one by default, or one that sees everything.

        Raises: StageError where there is none of that path.
        """
        cameras = self.scene.cameras
        if path is None:
            return cameras[0] if cameras else self._overview
        for camera in cameras:
            if camera.path == path:
                return camera
        some = ", ".join(c.path for c in cameras[:5]) + (f" and {len(cameras) - 5} more" if len(cameras) > 5 else "")
        known = f"there is {some}" if cameras else "leave it out, there is none"
        raise StageError(f"{self.scene.stage} has no camera {path}; {known}")

    @cached_property
    def _overview(self) -> Camera:
        return overview_camera(self.scene, self.tracer)

    def render(
        self, camera: Camera | str | None = None, size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (),
        samples: int = 16, **options: Any,
    ) -> dict[str, NDArray[np.float32]]:  # fmt: skip
        """Renders the shot as it is; returns pictures (h, w, c) by name, `color` first."""
        camera = camera if isinstance(camera, Camera) else self.camera(camera)
        field = self.light_field
        with self._step("render"):
            lit = LitScene(self.scene, self.tracer, field, self.lights, self.device)
            return render(lit, camera, size, ("color", *aovs), PictureOptions(samples, self.element_count, **options))

    def similarity(
        self, stroke: Stroke | Sequence[Stroke], camera: Camera | str | None = None,
        size: tuple[int, int] = (640, 360), weights: Weights | None = None,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Returns a picture (h, w, 1): how similar what each pixel shows is to the dabs of a stroke, or of several.

        Raises: StrokeError for a stroke that lies on no surface, or where there is none.
        """
        strokes = [stroke] if isinstance(stroke, Stroke) else list(stroke)
        if not strokes:
            raise StrokeError("similarity is to paint, and there is no stroke; paint one with: usdslf stroke")
        camera = camera if isinstance(camera, Camera) else self.camera(camera)
        tracer = self.tracer
        with self._step("similarity"):
            painted, reach = painted_places(self.scene, strokes, self.warnings)
            return similarity_picture(self.scene, tracer, camera, size, painted, reach, weights)

    def changes(self, mode: str = "") -> list[MaterialChange]:
        """Returns what `solve` or `stylize` found as changes of materials; mode `new` is of painted gprims only."""
        if self.stylized is not None:
            return restyled(self.stylized.styles, self.scene)
        active = [s for s in self.strokes if s.active]
        return changes_of(self.answers, self.scene, active, self.light_field, mode)

    def author(
        self,
        path: str | os.PathLike[str],
        strokes_path: str | os.PathLike[str] | None = None,
        review_root: str | os.PathLike[str] | None = None,
        mode: str = "",
    ) -> list[AuthoredEdit]:
        """Writes what `solve` found as a look layer, and on request a review root over look, strokes and shot.

        Args:
            mode: override (all that show the material) | new (a material for what was painted only) | class
                (all instances of the asset, by the class that it inherits); "": as each stroke's scope says.

        Raises: AuthorError where it cannot be written.
        """
        scene, color = self.scene, color_of(self.ocio, self.scene.working_space)
        provenance = {
            "version": usdslf.__version__,
            "ocioConfig": color.config_name,
            "workingSpace": scene.working_space,
            "device": self.device.name,
            "solve": self._how(),
            **({"frame": scene.frame} if np.isfinite(scene.frame) else {}),
        }
        if not model_of(self.model).is_authored:
            self._warn_of_phong()
        check_look_place(self.shot, path)
        with self._step("author"), kept_unless_whole(path):
            self.edits = author_look(
                self.shot, self._with_textures(self.changes(mode), path, color), path, provenance, strokes_path,
                warnings=self.warnings, color=color, mode=mode, made=self.made, frame=scene.frame,
            )  # fmt: skip
            self._require_shown(path)
            if review_root is not None:
                author_review_root(review_root, path, strokes_path, self.shot.GetRootLayer().realPath)
        for edit in self.edits:
            if not edit.wins:
                self.warn(f"{edit.prim}.{edit.attribute} is hidden by {edit.hidden_by}: {edit.mend}")
        self._measure_written(path)
        worse = [s for s in self.stylized.styles if s.is_worse_as_written] if self.stylized else []
        if not worse:
            return self.edits
        for style in worse:
            was, became = style.residual_before, style.residual_as_written
            self.warn(
                f"{scene.materials[style.material].path} stays as it is: as it can be written, its change brings it no "
                f"nearer to what was wanted, {was:.3f} became {became:.3f}"
            )
        self.stylized = self.stylized.without(worse) if self.stylized else None
        return self.author(path, strokes_path, review_root, mode)

    def _require_shown(self, look: str | os.PathLike[str]) -> None:
        """Reads the look back at what was painted; what it does not show is said, or refused where nothing hides it."""
        asked = asked_of(self.answers, self._painted, self.scene)
        if not asked:
            return
        missing = why_missing(asked, self.scene, scene_under(self.shot, look, self.frame, self.refine, self.ocio))
        if missing and all(e.wins for e in self.edits):
            self.edits = []
            raise AuthorError(f"{missing[0]}; nothing is written to {look}: solve with --scope prim or --mode new")
        self.warn(*missing)

    def _measure_written(self, look: str | os.PathLike[str]) -> None:
        """Looks at what a look shows where textures or points hold a change: they do only so well."""
        has_texture = any(e.representation == "texture" for e in self.edits)
        varying = [a for a in self.answers if a.varying or (has_texture and a.chosen.freed and not a.others)]
        self.residual_as_written = {}
        if not (varying or self.stylized) or not self.shot.GetRootLayer().realPath:
            return  # a shot in memory alone is in no look's reach
        other = self.edited(look)
        if len(other.scene.triangles.mesh) != len(self.scene.triangles.mesh):
            return
        with self._step("author"), self._kept_field() as field:
            elements = refresh_reflectance(self.elements, self.scene, other.scene)
            field.set_surface(Surface.of(elements))
            self._converge(field)
            if self.stylized:
                self.stylized = self.stylized.as_written(field)
            for a in varying:
                residual = residual_as_written(a, other.scene, self._painted, field)
                self.residual_as_written[a.pool] = residual
                if residual > MUCH_WORSE * max(a.residual_after, 0.02):
                    self.warn(
                        f"{self.scene.materials[a.pool.material].path}: the written look has a residual of "
                        f"{residual:.3f}, the change that was found one of {a.residual_after:.3f}"
                    )

    @contextmanager
    def _kept_field(self) -> Iterator[LightField]:
        """The light field for other reflectance, left as it was."""
        field = self.light_field
        original, outgoing_d = field.surface, field.outgoing_d.copy()
        try:
            yield field
        finally:
            field.set_surface(original)
            field.outgoing_d = outgoing_d

    def _warn_of_phong(self) -> None:
        """Says what a look holds that was solved with phong, and how far off it is where that was measured."""
        off = [
            f"{a.residual_after:.3f} becomes {self.residual_as_preview[a.pool]:.3f}"
            for a in self.answers
            if a.pool in self.residual_as_preview and a.chosen.freed
        ]
        measured = f"; the residual of {', '.join(off)}" if off else ""
        self.warn(
            "solved with phong: the look holds its k_d, k_s and width of lobe as diffuse, specular and roughness of "
            f"UsdPreviewSurface, which reflects otherwise, more so at grazing angles{measured}"
        )

    def _with_textures(
        self, changes: list[MaterialChange], look: str | os.PathLike[str], color: Color
    ) -> list[MaterialChange]:
        """Gives changes that vary over surfaces their textures beside the look, where they can have them."""
        s, folder = self.stylized, textures_folder(look)
        if s is None:
            return with_varying(changes, self.answers, self.scene, folder, color, self.warnings)
        styles = [style for style in s.styles if style.freed]
        return [
            with_styles(c, style, s, self.scene, self.elements, folder, color, self.warnings)
            for c, style in zip(changes, styles, strict=True)
        ]

    def _how(self) -> str:
        """How the look came about, for its provenance."""
        how = f"{self.model}, {len(self.elements)} elements, 1024 directions, {self.bounces} bounces"
        how += f", {self._solved_with}" if self._solved_with else ""
        s = self.stylized
        return how if s is None else f"stylized by {s.amount:g} within {s.radius:g} of the diagonal; {how}"

    def report(self) -> dict[str, Any]:
        """Returns what was inferred, as JSON-ready values (DESIGN: the report of solve).

        Of a stylized shot, `stylize` says how, and `materials` what became of each.
        """
        return report_of(self)

    def warn(self, *sentences: str) -> None:
        """Keeps warnings, each once."""
        self.warnings += [s for s in dict.fromkeys(sentences) if s not in self.warnings]


def open(stage: Any, **options: Any) -> Session:
    """Opens a shot; see `Session`."""
    return Session(stage, **options)
