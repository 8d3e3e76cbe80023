"""Notes on each opinion that a change wrote which input it is for, and what stood there before.

    Noting(look, material).note(edit, written) -> None      after each input that was written
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from pxr import Sdf, Usd, UsdShade

from usdslf.edits.edits import InputEdit
from usdslf.usd.layer.look_layer import LookLayer
from usdslf.usd.layer.opinions import file_digest, note_opinion, targets_of
from usdslf.usd.layer.wins import AuthoredEdit


class Noting:
    """What of a look layer has its notes already."""

    def __init__(self, look: LookLayer, material: str) -> None:
        """Notes what is there, and not noted, as for the whole Material: bindings and faces, which came first."""
        self._look, self._material = look, material
        for spec in self._fresh():
            note_opinion(spec, material)

    def note(self, edit_of: InputEdit, edits: Sequence[AuthoredEdit]) -> None:
        """Notes what an input's change wrote; a property of several inputs is for all of them."""
        target = f"{self._material}.inputs:{edit_of.input}"
        for edit in edits:
            spec = self._look.layer.GetPropertyAtPath(Sdf.Path(edit.prim).AppendProperty(edit.attribute))
            if spec is None:  # nothing could be written, which the edit says
                continue
            texture = self._texture(edit) if edit.representation == "scale" else ("", "")
            base = None if edit.attribute.startswith("primvars:") else edit.before
            note_opinion(spec, target, base, texture, edit_of.channels if texture[0] else "")
        for spec in self._fresh():
            note_opinion(spec, target)

    def _fresh(self) -> Iterator[Sdf.PropertySpec]:
        """Properties of the layer without notes."""
        layer, found = self._look.layer, list[Sdf.Path]()
        layer.Traverse(Sdf.Path.absoluteRootPath, lambda p: found.append(p) if p.IsPropertyPath() else None)
        specs = (layer.GetPropertyAtPath(p) for p in found)
        return iter([s for s in specs if s is not None and not targets_of(s)])

    def _texture(self, edit: AuthoredEdit) -> tuple[str, str]:
        """File, without folders of this machine, and digest of the texture that a scale or bias acts on."""
        prim: Usd.Prim = self._look.stage.GetPrimAtPath(Sdf.Path(edit.shown_at).GetPrimPath())
        port = UsdShade.Shader(prim).GetInput("file") if prim else None
        values = port.GetValueProducingAttributes() if port else []
        file = values[0].Get(self._look.time) if values else None
        if not isinstance(file, Sdf.AssetPath):
            return "", ""
        name = Path(file.path).name if Path(file.path).is_absolute() else file.path
        return name, file_digest(file.resolvedPath)
