"""The work of ui/test_painting.py once more on an X display, where windows are shown and have focus."""

from __future__ import annotations

import subprocess
import sys

from kit.displays import ROOT


def test_the_painting_tests_pass_on_an_x_display(display: dict[str, str]) -> None:
    work = "understood or pen or alt or selects or saved"
    command = [
        sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", work,
        "tests/hydra_viewer/ui/test_painting.py",
    ]  # fmt: skip
    display = {k: v for k, v in display.items() if k not in ("USDSLF_CLAIMS", "USDSLF_SHARE")}  # all of them
    run = subprocess.run(command, cwd=ROOT, env=display, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stdout[-4000:] + run.stderr[-2000:]
    assert "5 passed" in run.stdout
