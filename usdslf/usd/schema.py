"""Registers the stroke schema in time, or says why it could not.

    register_schema() -> None           cheap, may be called often; SchemaError if it came too late
    register_plugin(folder) -> str      makes USD's plugin registry know it; "" or why it does not

A plugin that is registered after USD's schema registry was filled is silently ignored, and a parse error in
generatedSchema.usda is only a warning: so every property is looked up once.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pxr import Plug, Tf, Usd

from usdslf import plugin_path
from usdslf.errors import SchemaError

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
)


def register_plugin(folder: Path) -> str:
    """Makes the plugin registry know the schema; returns why it does not, "" if it does."""
    try:
        Plug.Registry().RegisterPlugins(str(folder))
    except Tf.ErrorException as error:
        return next((line.strip() for line in str(error).splitlines() if line.strip()), "an error of USD")
    return ""


def missing_properties() -> list[str]:
    """Returns the properties of the schema that USD's registry does not know; fills the registry."""
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
    folder = plugin_path.schema_folder()
    if not folder:
        places = " or ".join(str(p) for p in plugin_path.PLACES)
        raise SchemaError(f"The stroke schema is missing from {places}: install usdslf again.")
    if reason := register_plugin(folder):
        raise SchemaError(f"The schema plugin {folder} is damaged ({reason}): reinstall usdslf.")
    missing = missing_properties()
    if len(missing) == len(PROPERTIES):
        raise SchemaError(
            f"USD did not take {API_SCHEMA} from {folder}, its schemas were in use before or the files are "
            f"damaged: import usdslf before a stage is opened, or set {plugin_path.VARIABLE} to that folder."
        )
    if missing:
        raise SchemaError(f"The schema in {folder} has no {', '.join(missing)}: install usdslf again.")
