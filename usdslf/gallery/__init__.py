"""The gallery: result figures of the paper as scenes built in code, with strokes and a check of each claim.

    ../shot.py    a shot as records without USD
    records.py    what an entry is, and what came of one
    play.py       an entry that is being run
    page.py       the index of all entries
    the others    one entry each, or a few on one scene
"""

from __future__ import annotations

from usdslf.gallery import (
    blue_wall,
    caustic,
    detail,
    fitting,
    indirect_room,
    shadow_diffuse,
    similarity,
    sketch_specular,
    still_life,
    stylize,
    tools,
    toys,
    upsampling,
    white_dab,
    white_room,
    window_light,
)
from usdslf.gallery.records import Entry

ENTRIES: tuple[Entry, ...] = (
    still_life.ENTRY,
    toys.ENTRY,
    white_dab.ENTRY,
    tools.ENTRY,
    indirect_room.MIRROR,
    similarity.ENTRY,
    blue_wall.ENTRY,
    fitting.FITTING,
    fitting.SPARSE,
    upsampling.ENTRY,
    shadow_diffuse.ENTRY,
    white_room.ENTRY,
    sketch_specular.ENTRY,
    indirect_room.DULL,
    indirect_room.GLOSSY,
    caustic.ENTRY,
    window_light.ENTRY,
    detail.ENTRY,
    stylize.ENTRY,
)
"""All entries; the first one is run where none is named."""
