"""The stroke schema: every property is there, in a checkout and in a wheel, or a clear error."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Plug, Sdf, Usd

from usdslf.errors import SchemaError
from usdslf.usd import schema

ROOT = Path(__file__).resolve().parents[2]


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {k: v for k, v in os.environ.items() if k != "PXR_PLUGINPATH_NAME"}
    clean |= {"PYTHONPATH": str(ROOT)} | environment
    return subprocess.run([sys.executable, "-P", "-c", code], env=clean, capture_output=True, text=True)


def test_every_property_is_known_after_registering() -> None:
    schema.register_schema()
    assert schema.missing_properties() == []
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI")
    assert sorted(definition.GetPropertyNames()) == sorted(schema.PROPERTIES)


def test_source_and_generated_schema_agree() -> None:
    source = Sdf.Layer.OpenAsAnonymous(str(ROOT / "schemas/generatedSchema.usda"))
    text = (ROOT / "schemas/schema.usda").read_text()
    spec = source.GetPrimAtPath("/SlfStrokeAPI")
    assert len(spec.attributes) + len(spec.relationships) == 15
    for name, attribute in spec.attributes.items():
        assert name in text
        if attribute.default is not None and attribute.typeName == "token":
            assert f'{name} = "{attribute.default}"' in text


def test_types_and_variability_are_those_of_the_contract() -> None:
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI")
    types = {
        "slf:tool": ("token", True), "slf:mode": ("token", True), "slf:strength": ("float", True),
        "slf:space": ("token", True), "slf:eye": ("point3f[]", False), "slf:surfaceIndex": ("int[]", False),
        "slf:face": ("int[]", False), "slf:barycentric": ("float2[]", False),
        "slf:timeCode": ("double", True),
        "slf:norm": ("token", True), "slf:scope": ("token", True), "slf:choice": ("string", True),
        "slf:cloneOffset": ("vector3f", False), "slf:filmNormal": ("vector3f", False),
    }  # fmt: skip
    for name, (kind, uniform) in types.items():
        spec = definition.GetSchemaAttributeSpec(name)
        assert str(spec.typeName) == kind, name
        assert (spec.variability == Sdf.VariabilityUniform) == uniform, name
    assert definition.GetSchemaRelationshipSpec("slf:surfaces")


LATE = """
from pxr import Usd
{before}
import usdslf
from usdslf.errors import SchemaError
from usdslf.usd.schema import register_schema
try:
    register_schema()
except SchemaError as error:
    assert error.exit_code == 3
    print(error)
"""


@pytest.mark.parametrize("before", ["", "stage = Usd.Stage.CreateInMemory()"])
def test_usd_may_be_loaded_before_usdslf(before: str) -> None:
    done = run_python(LATE.format(before=before))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_too_late_is_said_in_one_line_and_how_to_mend_it() -> None:
    code = LATE.format(before='Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("CollectionAPI")')
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    assert "in use before" in done.stdout and "PXR_PLUGINPATH_NAME" in done.stdout
    assert done.stdout.count("\n") == 1
    mended = run_python(code, PXR_PLUGINPATH_NAME=str(ROOT / "schemas"))
    assert (mended.returncode, mended.stdout) == (0, ""), mended.stderr


def test_importing_usdslf_is_enough_and_loads_no_usd() -> None:
    code = """
import sys, usdslf
assert not any(name.startswith("pxr") for name in sys.modules)
from pxr import Usd, UsdGeom
stage = Usd.Stage.CreateInMemory()
UsdGeom.Sphere.Define(stage, "/a")
print(len(Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI").GetPropertyNames()))
from usdslf.usd.schema import register_schema
register_schema()
"""
    done = run_python(code)
    assert (done.stdout.strip(), done.stderr) == (str(len(schema.PROPERTIES)), "")


def test_others_find_the_schema_by_the_plugin_path() -> None:
    code = """
from pxr import Usd
print(len(Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI").GetPropertyNames()))
"""
    done = run_python(code, PXR_PLUGINPATH_NAME=str(ROOT / "schemas"))
    assert done.stdout.strip() == str(len(schema.PROPERTIES))


def test_a_wheels_folder_is_found_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wheel = tmp_path / "_schemas"
    shutil.copytree(ROOT / "schemas", wheel)
    monkeypatch.setattr(schema, "PLACES", (wheel, ROOT / "schemas"))
    assert schema.schema_folder() == wheel
    monkeypatch.setattr(schema, "PLACES", (tmp_path / "none",))
    schema.register_schema.cache_clear()
    with pytest.raises(SchemaError, match="missing from"):
        schema.register_schema()


@pytest.mark.parametrize(
    ("damage", "word"),
    [("slf:mode", "has no slf:mode"), ("everything", "did not take"), ("json", "damaged")],
)
def test_a_damaged_schema_is_noticed(tmp_path: Path, damage: str, word: str) -> None:
    shutil.copytree(ROOT / "usdslf", tmp_path / "usdslf", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "schemas", tmp_path / "schemas")
    generated = tmp_path / "schemas/generatedSchema.usda"
    if damage == "json":
        (tmp_path / "schemas/plugInfo.json").write_text("{ broken")
    elif damage == "everything":
        generated.write_text("#usda 1.0\nclass {")
    else:
        generated.write_text(generated.read_text().replace(damage, "slf:renamed"))
    code = f"""
import re
import usdslf
from usdslf.errors import SchemaError
from usdslf.usd.schema import register_schema
try:
    register_schema()
except SchemaError as error:
    assert re.search({word!r}, str(error)), str(error)
    print("said")
"""
    done = run_python(code, PYTHONPATH=str(tmp_path))
    assert done.stdout.strip() == "said", done.stdout + done.stderr


def test_registering_twice_is_harmless() -> None:
    schema.register_schema()
    schema.register_schema()
    assert Plug.Registry().GetPluginWithName("usdslf")
