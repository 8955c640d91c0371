"""``python -m benchmarks.masters.runner TOOL JOB RESULT``: one tool, one process, one result file.

The file is ``{}`` when the tool is not installed. Else it holds ``[[wall, cpu], ...]`` in seconds, one pair per run,
where the watched outputs were at the end of the last, and the tool's version. Results go to a file because tools
print. A tool with a clock of its own has no ``cpu``.
"""

import gc
import json
import os
import sys
import time
from pathlib import Path

from benchmarks.masters.job import read_job
from benchmarks.masters.memory import peak_memory
from benchmarks.masters.tools import TOOLS

RUNS = 3


def main(arguments: list[str]) -> int:
    """Run the tool; a tool whose job is good for one run is set up anew for each."""
    tool, job, result = TOOLS[arguments[0]], read_job(Path(arguments[1])), Path(arguments[2])
    if not tool.installed:
        result.write_text("{}", encoding="utf-8")
        return 0
    prepared = tool.prepare(job)
    times: list[tuple[float, float | None]] = []
    for k in range(RUNS):
        if k and not tool.again:
            prepared = tool.prepare(job)
        gc.collect()
        wall, cpu = time.perf_counter(), time.process_time()
        own = prepared.run()
        used = time.perf_counter() - wall, time.process_time() - cpu
        times.append(used if own is None else (own, None))
    found = {"times": times, "peak_kib": peak_memory(), "ends": dict(prepared.ends()), "version": tool.version()}
    result.write_text(json.dumps(found), encoding="utf-8")
    sys.stdout.flush()
    os._exit(0)  # some tools' libraries do not survive the end of the interpreter


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
