"""The stroke schema: tells USD where it is in time, or says why it could not.

    schema_folder() -> Path | None     where plugInfo.json is: a wheel's or a checkout's
    announce_schema() -> None          at the import of usdslf; pxr is not imported for it
    register_schema() -> None          cheap, may be called often; SchemaError if it came too late
    register_plugin(folder) -> str     makes USD's plugin registry know it; "" or why it does not

USD reads PXR_PLUGINPATH_NAME when it is loaded, and fills its schema registry at the first stage.  A plugin that is
registered after that is silently ignored.  So the variable is set before USD is loaded, which is the only time that
surely is in time; a program that loaded USD earlier gets the plugin by its registry, which is in time if no stage was
opened yet.  A parse error in generatedSchema.usda is only a warning: so every property is looked up once.

pxr is imported inside of functions here, so that `usdslf --help` does not wait for it.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from pathlib import Path

from usdslf.errors import SchemaError

VARIABLE = "PXR_PLUGINPATH_NAME"
_PACKAGE = Path(__file__).resolve().parents[1]
PLACES = (_PACKAGE / "_schemas", _PACKAGE.parent / "schemas")  # a wheel, a checkout
API_SCHEMA = "SlfStrokeAPI"
PROPERTIES = (
    "slf:tool",
    "slf:mode",
    "slf:strength",
    "slf:space",
    "slf:eye",
    "slf:surfaces",
    "slf:surfaceIndex",
    "slf:face",
    "slf:barycentric",
    "slf:timeCode",
    "slf:norm",
    "slf:scope",
    "slf:choice",
    "slf:cloneOffset",
    "slf:filmNormal",
)


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
        register_plugin(folder)
        return
    known = os.environ.get(VARIABLE, "")
    if str(folder) not in known.split(os.pathsep):
        os.environ[VARIABLE] = os.pathsep.join(filter(None, (known, str(folder))))


def register_plugin(folder: Path) -> str:
    """Makes the plugin registry know the schema; returns why it does not, "" if it does."""
    from pxr import Plug, Tf

    try:
        Plug.Registry().RegisterPlugins(str(folder))
    except Tf.ErrorException as error:
        return next((line.strip() for line in str(error).splitlines() if line.strip()), "an error of USD")
    return ""


def missing_properties() -> list[str]:
    """Returns the properties of the schema that USD's registry does not know; fills the registry."""
    from pxr import Tf, Usd

    try:
        definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(API_SCHEMA)
    except Tf.ErrorException:  # a parse error, of any plugin's schema; USD has printed it
        definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(API_SCHEMA)
    known = set(definition.GetPropertyNames()) if definition else set()
    return [name for name in PROPERTIES if name not in known]


@cache
def register_schema() -> None:
    """Makes USD know SlfStrokeAPI.

    Raises:
        SchemaError: the files are missing or damaged, or USD's schemas were in use before.
    """
    folder = schema_folder()
    if not folder:
        places = " or ".join(str(p) for p in PLACES)
        raise SchemaError(f"the stroke schema is missing from {places}: install usdslf again")
    if reason := register_plugin(folder):
        raise SchemaError(f"the schema plugin {folder} is damaged ({reason}): reinstall usdslf")
    missing = missing_properties()
    if len(missing) == len(PROPERTIES):
        raise SchemaError(
            f"USD did not take {API_SCHEMA} from {folder}, its schemas were in use before or the files are "
            f"damaged: import usdslf before a stage is opened, or set {VARIABLE} to that folder"
        )
    if missing:
        raise SchemaError(f"the schema in {folder} has no {', '.join(missing)}: install usdslf again")
