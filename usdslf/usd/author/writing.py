"""Writing of one solved change into a look layer, or of several explanations of it as variants of one Material.

    Writing(look, folder, said, color, mode).write(change, instead) -> edits, bindings
                                            .write_all(change, rivals) -> the same, of the first
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pxr import Sdf

from usdslf.edits.edits import MaterialChange, inferred, material_change_to_input_edits
from usdslf.errors import AuthorError
from usdslf.usd.author.change_writer import ChangeWriter
from usdslf.usd.author.noting import Noting
from usdslf.usd.author.variants import gather_variants, variant_name
from usdslf.usd.layer.look_layer import LookLayer, shader_of
from usdslf.usd.layer.wins import AuthoredEdit

if TYPE_CHECKING:
    from usdslf.color import Color

Bound = list[tuple[Sdf.Path, Sdf.Path]]  # prims and the Materials that they should show


@dataclass(frozen=True)
class Instead:
    """Another way to write the change of a material."""

    is_new: bool  # to a new material for all that would change, whatever its scope
    is_constant: bool  # as one value for an input, cut off from what drives it

    def __str__(self) -> str:
        ways = ("a new material", self.is_new), ("constants, cut off from what drives them", self.is_constant)
        return " with ".join(words for words, is_so in ways if is_so)


@dataclass(frozen=True)
class Writing:
    """Where and how changes are written.

    Attributes:
        look: the layer.
        folder: that files are named from.
        said: takes a sentence for each thing that is odd.
        color: its working space is that of the changes.
        mode: of material_writer.py.
    """

    look: LookLayer
    folder: Path
    said: list[str]
    color: Color | None
    mode: str

    def write(self, change: MaterialChange, instead: Instead | None = None) -> tuple[list[AuthoredEdit], Bound]:
        """Writes a change; nothing where it is none.

        Args:
            instead: another way than usual.
        """
        made = self._write(change, "new" if instead and instead.is_new else self.mode, instead)
        return (made[1], made[0].bound) if made else ([], [])

    def write_all(
        self, change: MaterialChange, rivals: Sequence[MaterialChange]
    ) -> tuple[list[AuthoredEdit], Bound]:
        """Writes a change and other explanations of it as variants of one Material; returns the edits of the first.

        What cannot be written is said; a change without another one is written as usual.
        """
        original = Sdf.Path(change.material.path)
        if not shader_of(self.look.stage, original).GetPath().HasPrefix(original):
            self.said.append(f"{original} has no alternatives in the look: its shader stands outside of it")
            return self.write(change)
        first = self._write(change, "new")
        if first is None:
            return [], []
        writer, edits = first
        place = self.look.place
        made = {variant_name(inferred(change.freed)): place(writer.material)}
        for rival in rivals:
            before = Sdf.Layer.CreateAnonymous(".usda")
            before.TransferContent(self.look.layer)
            try:
                other = self._write(rival, "new")
            except AuthorError as error:
                self.look.layer.TransferContent(before)
                self.said.append(f"{inferred(rival.freed)} is not among the alternatives: {error}")
                continue
            if other:
                made.setdefault(variant_name(inferred(rival.freed)), place(other[0].material))
        home = gather_variants(self.look.layer, writer.original, made)
        selected = home.AppendVariantSelection(*_selected(self.look.layer, home))
        moved = [
            replace(e, prim=str(Sdf.Path(e.prim).ReplacePrefix(home, selected)))
            if Sdf.Path(e.prim).HasPrefix(home)
            else e
            for e in edits
        ]
        return moved, writer.bound

    def _write(
        self, change: MaterialChange, mode: str, instead: Instead | None = None
    ) -> tuple[ChangeWriter, list[AuthoredEdit]] | None:
        inputs = material_change_to_input_edits(change)
        if not inputs:
            return None
        writer = ChangeWriter(self.look, change, self.folder, self.said, self.color, mode)
        writer.is_constant = instead is not None and instead.is_constant
        noting = Noting(self.look, str(writer.material))
        written: list[AuthoredEdit] = []
        for edit in inputs:
            found = writer.write(edit)
            noting.note(edit, found)
            written += found
        if written:
            writer.write_provenance()
        return writer, written


def _selected(layer: Sdf.Layer, material: Sdf.Path) -> tuple[str, str]:
    """The set and the name of the variant of a Material that is selected."""
    ((group, chosen),) = layer.GetPrimAtPath(material).variantSelections.items()
    return group, chosen
