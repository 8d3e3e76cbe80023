"""A wheel and an editable install both find kernels and schemas, from a folder that is not the repository."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PROBE = """
import site, sys
site.addsitedir(sys.argv[1])
sys.path.append(sys.argv[2])
import usdslf, usdslf.cli
from usdslf.gpu.source import kernel_folder, kernel_source
from usdslf.usd.schema import schema_folder
assert "kernel" in kernel_source("light_field")
assert "SlfStrokeAPI" in (schema_folder() / "generatedSchema.usda").read_text()
import hydra_viewer
print(usdslf.__file__, kernel_folder(), schema_folder(), sep="\\n")
"""


def build(hook: str, folder: Path) -> Path:
    """Runs a build hook of the project's backend in the repository; returns the file it made."""
    code = f"import hatchling.build, sys; print(hatchling.build.{hook}(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(folder)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.split()[-1]


def installed(hook: str, folder: Path) -> Path:
    """Unpacks a wheel as an installer does; returns the folder that stands for site-packages."""
    site = folder / "site"
    with zipfile.ZipFile(build(hook, folder)) as wheel:
        wheel.extractall(site)
    return site


def probe(site: Path, cwd: Path) -> list[Path]:
    """Imports usdslf from `site` alone, dependencies from this environment, and says what it found."""
    # -S and a plain path: an editable install in this environment must not help.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    command = [sys.executable, "-S", "-P", "-c", PROBE, str(site), sysconfig.get_path("purelib")]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return [Path(line) for line in done.stdout.split("\n") if line]


def test_wheel_carries_kernels_and_schemas(tmp_path: Path) -> None:
    site = installed("build_wheel", tmp_path)
    package, kernels, schemas = probe(site, tmp_path)
    assert package == site / "usdslf/__init__.py"
    assert kernels == site / "usdslf/_kernels"
    assert schemas == site / "usdslf/_schemas"
    (metadata,) = site.glob("usdslf-*.dist-info")
    assert "usdslf = usdslf.cli.main:main" in (metadata / "entry_points.txt").read_text()
    assert "Apache License" in (metadata / "licenses/LICENSE").read_text()
    assert {p.name for p in site.iterdir()} == {"usdslf", "hydra_viewer", metadata.name}


def test_editable_install_uses_the_checkout(tmp_path: Path) -> None:
    package, kernels, schemas = probe(installed("build_editable", tmp_path), tmp_path)
    assert package == ROOT / "usdslf/__init__.py"
    assert kernels == ROOT / "kernels"
    assert schemas == ROOT / "schemas"


@pytest.mark.parametrize("folder", ["kernels", "schemas"])
def test_wheel_carries_every_file(folder: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(build("build_wheel", tmp_path)) as wheel:
        inside = {n.split("/", 2)[2] for n in wheel.namelist() if n.startswith(f"usdslf/_{folder}/")}
    beside = {p.relative_to(ROOT / folder).as_posix() for p in (ROOT / folder).rglob("*") if p.is_file()}
    assert {n for n in inside if "__pycache__" not in n} == {n for n in beside if "__pycache__" not in n}
    assert inside
