"""Tells USD where the stroke schema is before USD is loaded, which is the only time that surely is in time.

    schema_folder() -> Path | None     where plugInfo.json is: a wheel's or a checkout's
    announce_schema() -> None          at the import of usdslf; no pxr is imported for it

USD reads PXR_PLUGINPATH_NAME when it is loaded, and fills its schema registry at the first stage.  A program
that loaded USD earlier gets the plugin by its registry instead, which is in time if no stage was opened yet;
`usd.schema.register_schema` finds out.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

VARIABLE = "PXR_PLUGINPATH_NAME"
_PACKAGE = Path(__file__).resolve().parent
PLACES = (_PACKAGE / "_schemas", _PACKAGE.parent / "schemas")  # a wheel, a checkout


def schema_folder() -> Path | None:
    """Returns the folder that holds plugInfo.json and generatedSchema.usda, or None."""
    files = ("plugInfo.json", "generatedSchema.usda")
    return next((p for p in PLACES if all((p / name).is_file() for name in files)), None)


def announce_schema() -> None:
    """Puts the schema's folder on USD's plugin path; says nothing where it is missing."""
    folder = schema_folder()
    if not folder:
        return
    if "pxr" in sys.modules:
        from usdslf.usd.schema import register_plugin

        register_plugin(folder)
        return
    known = os.environ.get(VARIABLE, "")
    if str(folder) not in known.split(os.pathsep):
        os.environ[VARIABLE] = os.pathsep.join(filter(None, (known, str(folder))))
