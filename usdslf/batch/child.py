"""Child: the process of one job, `python -m usdslf.batch.child`.

It reads the row of the job as a line of JSON from stdin, and writes lines of JSON to stdout: {"step", "share"} while it
works, then {"done"} with the result, or {"error"} with a sentence.  It ends at once when stdin does, as then nobody
waits for it any more.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from typing import Any

TOLD_EVERY = 0.2  # seconds


def main() -> int:
    """Does the job of stdin; returns the exit code of the process."""
    from usdslf.batch.job import Job
    from usdslf.batch.work import run_job
    from usdslf.errors import UsdslfError

    out = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    os.dup2(2, 1)  # what libraries print is talk
    told = 0.0

    def write(**values: Any) -> None:
        out.write(json.dumps(values) + "\n")

    def say(step: str, share: float) -> None:
        nonlocal told
        if time.monotonic() - told > TOLD_EVERY:
            told = time.monotonic()
            write(step=step, share=round(share, 3))

    line = sys.stdin.readline()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        result = run_job(Job.of_json(line), say)
    except UsdslfError as error:
        write(error=" ".join(str(error).split()))
        return error.exit_code
    except MemoryError:
        write(error="there is not enough memory; lower `elements`")
        return 4
    write(done=result.as_values())
    return 0


def _end_with_parent() -> None:
    """Ends this process when stdin ends."""
    while sys.stdin.read(1):
        pass
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
