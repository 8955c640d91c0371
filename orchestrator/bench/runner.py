"""``python -m orchestrator.bench.runner TOOL JOB RESULT``: one tool, one process, one result file.

The file holds ``[[wall, cpu], ...]`` in seconds, one pair per run. Times go to a file because tools print.
"""

import gc
import json
import resource
import sys
import time
from pathlib import Path

from orchestrator.bench.job import read_job
from orchestrator.bench.tools import TOOLS

RUNS = 3


def main(arguments: list[str]) -> int:
    """Run the tool; a tool whose call is good for one run is set up anew for each."""
    tool, job = TOOLS[arguments[0]], read_job(Path(arguments[1]))
    run = tool.prepare(job)
    times = []
    for k in range(RUNS):
        if k and not tool.again:
            run = tool.prepare(job)
        gc.collect()
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        times.append([time.perf_counter() - wall, time.process_time() - cpu])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    Path(arguments[2]).write_text(json.dumps({"times": times, "peak_kib": peak}), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
