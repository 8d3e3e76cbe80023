"""Links: what the kernel packs is what the host unpacks, and both know the same constants."""

from __future__ import annotations

import re

import numpy as np

from usdslf.elements.lookup import BLEND
from usdslf.gpu.source import kernel_source
from usdslf.light_field.links import BIN_BITS, BLOCKED, ESCAPES, MOST_ELEMENTS, element_of, is_link
from usdslf.sampling.hemisphere import SIDE, D


def test_kernels_and_host_have_the_same_constants() -> None:
    text = kernel_source("links")
    value = {
        name: int(re.search(rf"#define {name} +(\w+)", text)[1].rstrip("u"), 0)
        for name in ("ESCAPES", "BLOCKED", "BLEND", "SIDE")
    }
    assert value == {"ESCAPES": ESCAPES, "BLOCKED": BLOCKED, "BLEND": BLEND, "SIDE": SIDE}
    assert 1 << BIN_BITS == D == SIDE * SIDE


def test_the_last_element_that_fits_is_told_from_what_is_no_link() -> None:
    last = MOST_ELEMENTS - 2
    links = np.array([0, D, last * D + D - 1, BLOCKED, ESCAPES], np.uint32)
    assert is_link(links).tolist() == [True, True, True, False, False]
    assert element_of(links[:3]).tolist() == [0, 1, last]
