"""What tests share: the real stages, the OpenCL device, and no silent gaps.

Real stages lie in ../shared/assets beside the repository.  A clone elsewhere has none: there the tests that
ask for the fixture `assets` are left out and the summary says how many.  With CI or USDSLF_REQUIRE_ASSETS
set they fail instead.  `--no-skips` makes a run with a skipped test fail.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from kit import displays
from kit.share import claims, first_of_share, is_alike, not_taken, share_of

import usdslf  # noqa: F401  (announces the stroke schema before a test opens a stage)
from usdslf import cache

if TYPE_CHECKING:
    from usdslf.gpu.device import Device

# Each test computes what it asks for; commands that it starts too.  The gate sets "all", as the program does by itself.
os.environ.setdefault("USDSLF_CACHE", "weights")

ASSETS = Path(__file__).resolve().parents[2] / "shared/assets"
INPUTS = ASSETS.parent / "inputs"  # small stages that once failed
_left_out = pytest.StashKey[int]()
_asked_by_others = pytest.StashKey[int]()


def _assets_required() -> bool:
    return bool(os.environ.get("CI") or os.environ.get("USDSLF_REQUIRE_ASSETS"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="a skipped test makes the run fail")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    divided = {item: piece for item in items if (piece := _piece(item))}
    if not claims():
        mine = set(share_of(list(dict.fromkeys(divided.values()))))
        items[:] = [item for item in items if divided.get(item) in (None, *mine)]
    # What all runs ask stands first: the rest is taken as each comes to it, so that all end at the same time.
    rest = set(divided) if claims() else set()
    items[:] = [*_from_share([i for i in items if i not in rest]), *(i for i in items if i in rest)]
    if _assets_required():
        return
    missing = {name for name, folder in (("assets", ASSETS), ("inputs", INPUTS)) if not folder.is_dir()}
    without = [item for item in items if missing & set(getattr(item, "fixturenames", ()))]
    if not without:
        return
    config.stash[_left_out] = len(without)
    config.hook.pytest_deselected(items=without)
    items[:] = [item for item in items if item not in without]


def _piece(item: pytest.Item) -> str | None:
    """What one of several runs side by side asks: a module, or a case that is marked so; None is for all."""
    if item.get_closest_marker("divided"):
        return item.nodeid
    return str(item.path) if is_alike(item.path) else None


def _from_share(items: list[pytest.Item]) -> list[pytest.Item]:
    """Begins with the modules of this run's share, so that each of several finds in the cache what others made."""
    modules = list(dict.fromkeys(item.path for item in items))
    first = set(modules[: first_of_share(len(modules))])
    return [item for item in items if item.path not in first] + [item for item in items if item.path in first]


def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """pytest's own loop, over what this run takes where others run beside it."""
    folder = claims()
    if folder is None or session.config.option.collectonly or session.testsfailed:
        return None
    asked = 0
    items = not_taken(session.items, _piece, folder)
    item = next(items, None)
    while item is not None:
        asked, following = asked + 1, next(items, None)
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.shouldfail or session.shouldstop:
            raise session.Failed(session.shouldfail or session.shouldstop)
        item = following
    session.config.stash[_asked_by_others] = len(session.items) - asked
    return True


@pytest.fixture(autouse=True)
def _nothing_kept_of_what_is_patched(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a test computes with parts of the program exchanged is neither kept for others nor read from them."""
    patched = "monkeypatch" in request.fixturenames and cache.keeps(True)
    with cache.switched("weights") if patched else nullcontext():
        yield


@pytest.fixture
def nothing_kept() -> Iterator[None]:
    """For tests of how work goes on: nothing of a shot is read from the cache."""
    with cache.switched("weights"):
        yield


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    left_out = (reporter and reporter.stats.get("skipped")) or displays.why_no_qt()
    if session.config.getoption("--no-skips") and left_out and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    count = config.stash.get(_left_out, 0)
    if count:
        terminalreporter.write_line(f"left out: {count} tests on real stages, there is no folder {ASSETS}")
    elsewhere = config.stash.get(_asked_by_others, 0)
    if elsewhere:
        terminalreporter.write_line(f"{elsewhere} tests more, alike on all, are asked by the runs beside this one")
    why_no_qt = displays.why_no_qt()
    if why_no_qt:
        terminalreporter.write_line(f"left out: the tests of windows, Qt cannot be loaded: {why_no_qt}")
    if config.getoption("--no-skips") and terminalreporter.stats.get("skipped"):
        terminalreporter.write_line("failed: a test was skipped (--no-skips)", red=True)


@pytest.fixture(scope="session")
def assets() -> Path:
    """The folder of real stages."""
    if not ASSETS.is_dir():
        pytest.fail(f"the folder of real stages {ASSETS} is missing (CI or USDSLF_REQUIRE_ASSETS is set)")
    return ASSETS


@pytest.fixture(scope="session")
def inputs() -> Path:
    """The folder of small stages that once failed."""
    if not INPUTS.is_dir():
        pytest.fail(f"the folder of stages {INPUTS} is missing (CI or USDSLF_REQUIRE_ASSETS is set)")
    return INPUTS


@pytest.fixture(scope="session")
def device() -> Device:
    """The OpenCL device that the program would choose, once a run."""
    from usdslf.gpu.device import open_device

    return open_device()


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """The command line in this process: run("info", path) -> exit code, stdout, stderr."""
    from usdslf.cli.main import main

    def command(*arguments: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = main([str(a) for a in arguments])
        out, err = capfd.readouterr()
        return code, out, err

    return command
