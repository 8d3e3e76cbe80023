"""Runs the command line on faulty files, in a process that may crash: `fuzz_worker.py FOLDER FIRST LAST`.

FOLDER holds shot.usda, strokes.usda and look.usda.  Case n damages one of them with the random numbers of seed n and
gives it to a command.  Prints a JSON line before and one after each case; test_fuzz reads them.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from kit.fuzzed import fault

from usdslf.cli.main import main as command_line

CODES = (0, 1, 2, 3, 4, 5, 6)
PAINT = ("--camera", "/World/cam", "--path", "0.47,0.7 0.53,0.7", "--color", ".1,.4,.05")
LONGEST = 1500  # letters of a sentence
SOLVED = 48  # one case in so many goes through solve, a kind of file each


def commands_of(case: int, folder: Path, faulty: dict[str, Path]) -> list[list[str]]:
    """The command lines that a case runs; the first file of `faulty` is the damaged one."""
    shot, strokes, look = (str(faulty.get(n, folder / f"{n}.usda")) for n in ("shot", "strokes", "look"))
    own = str(folder / f"own_{case}.usda")
    solve = ["solve", shot, strokes, "-o", own, "--elements", "150", "--bounces", "2"]
    if "shot" in faulty:
        also = [solve] if case % SOLVED in (1, 4, 5) else [["stroke", shot, own, *PAINT]] if case % 4 == 0 else []
        return [["info", shot, "--json"], *also]
    if "strokes" in faulty:
        return [solve] if case % SOLVED in (3, 7, 11) else [["stroke", str(folder / "shot.usda"), strokes, *PAINT]]
    solve = ["solve", shot, strokes, "-o", look, "--elements", "150", "--bounces", "2"]
    return [solve] if case % SOLVED in (2, 10, 14) else [["review", shot, look], ["info", look]]


def run(arguments: list[str]) -> dict[str, Any]:
    """What a command line ends in, and what is wrong with that."""
    wrong: list[str] = []
    with _captured() as said:
        try:
            code: Any = command_line(arguments)
        except BaseException:
            code, wrong = -1, [traceback.format_exc()]
    out, err = said
    lines = err.splitlines()
    errors = [x for x in lines if x.startswith("usdslf: ")]
    if code not in CODES:
        wrong.append(f"exit code {code}")
    if code and not (code == 1 and arguments[0] == "review" and not errors) and len(errors) != 1:
        wrong.append(f"{len(errors)} sentences")
    if not code and errors:
        wrong.append("an error with exit code 0")
    wrong += [f"said: {x[:300]}" for x in lines if not x.startswith(("usdslf: ", "warning: "))]
    wrong += [x for x in errors if "internal error" in x or len(x) > LONGEST or x.endswith(".")]
    wrong += [x for x in errors if re.search(r"Error in '|Traceback|pxrInternal|\bat line \d+ of .*\.cpp", x)]
    if not code and arguments[-1] == "--json":
        json.loads(out, parse_constant=lambda name: wrong.append(f"{name} in the JSON"))
    return {"run": arguments, "code": code, "wrong": wrong, "sentence": errors[-1] if errors else ""}


@contextlib.contextmanager
def _captured() -> Iterator[list[str]]:
    """What goes to file descriptors 1 and 2, be it by C++."""
    said: list[str] = []
    files = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115
    kept = [os.dup(1), os.dup(2)]
    out, err = sys.stdout, sys.stderr
    try:
        for number, file in enumerate(files, 1):
            os.dup2(file.fileno(), number)
        sys.stdout, sys.stderr = (io.TextIOWrapper(os.fdopen(os.dup(n), "wb"), "utf-8") for n in (1, 2))
        yield said
    finally:
        sys.stdout.close()
        sys.stderr.close()
        sys.stdout, sys.stderr = out, err
        for number, old in enumerate(kept, 1):
            os.dup2(old, number)
            os.close(old)
        for file in files:
            file.seek(0)
            said.append(file.read().decode("utf-8", "backslashreplace"))
            file.close()


def main() -> None:
    folder, first, last = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    texts = {name: (folder / f"{name}.usda").read_text() for name in ("shot", "strokes", "look")}
    channel = os.fdopen(os.dup(1), "w", encoding="utf-8")
    for case in range(first, last):
        kind = ("shot", "shot", "look", "strokes")[case % 4] if case % 8 else "look"
        random = np.random.default_rng(case)
        path = folder / f"{kind}_{case}.usda"
        path.write_bytes(fault(texts[kind], random))
        for arguments in commands_of(case, folder, {kind: path}):
            print(json.dumps({"case": case, "starts": arguments}), file=channel, flush=True)
            since = time.monotonic()
            found = {"case": case, **run(arguments)} | {"seconds": round(time.monotonic() - since, 3)}
            print(json.dumps(found), file=channel, flush=True)
        for rest in folder.glob(f"*_{case}.*"):
            shutil.rmtree(rest) if rest.is_dir() else rest.unlink()


if __name__ == "__main__":
    main()
