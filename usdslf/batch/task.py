"""Task: a job as a task of a farm, `python -m usdslf.batch.task MANIFEST OUTPUT JOB`.

Farms end a session where the process of a task is lost, `openjd run` among them.  So the task is this small process,
which waits for another one that does what `usdslf batch --job` does.  Where that is ended from outside, as the system
does where memory runs out, the failure is kept with its sentence and the task ends well: other tasks go on, and
`usdslf batch --collect` says what failed.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from types import FrameType


def main(arguments: Sequence[str]) -> int:
    """Does a job in another process; returns the exit code of the task.

    Args:
        arguments: manifest, folder of all results, name of the job.
    """
    manifest, output, name = arguments
    process = subprocess.Popen([sys.executable, "-m", "usdslf", "batch", manifest, "-o", output, "--job", name])

    def stop(number: int, frame: FrameType | None) -> None:
        process.send_signal(number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        code = process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if code >= 0:
        return code
    from usdslf.batch.apart import signal_in_words
    from usdslf.batch.planning import plan
    from usdslf.batch.records import write_failure

    why = f"the process of its task was ended by {signal_in_words(-code)}"
    write_failure(plan(manifest, output).job(name), why, "crash")
    print(f"failed: {why}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
