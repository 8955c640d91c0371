"""A sweep of the engine's test work as a program of its own, for tests that kill, starve or interrupt it.

Usage: ``python -m tests.support.engine_driver DIR CASES SECONDS_PER_CASE WORKERS [--resume] [--file-limit BYTES]``
"""

import argparse
import resource
import signal
import sys
from pathlib import Path

from orchestrator.engine import DesignCases, Interrupted, LocalProcesses, run_cases, write_csv
from orchestrator.engine.grid import Ranged
from orchestrator.errors import OrchestratorError
from tests.support import engine_work


def main() -> int:
    """Run the sweep; print the peak memory of this process in bytes when it is done."""
    parser = argparse.ArgumentParser()
    parser.add_argument("directory", type=Path)
    parser.add_argument("cases", type=int)
    parser.add_argument("wait", type=float)
    parser.add_argument("workers", type=int)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--file-limit", type=int)
    args = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # shells start background jobs with SIGINT ignored
    if args.file_limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (args.file_limit, resource.RLIM_INFINITY))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    cases = DesignCases(Ranged("size", 0.0, 1.0, args.cases), 7)
    work = engine_work.work(wait=args.wait)
    try:
        with run_cases(
            cases,
            work,
            args.directory / "sweep.journal",
            open_pool=LocalProcesses(args.workers),
            resume=args.resume,
        ) as sweep:
            partial = args.directory / ".table.csv"
            write_csv(partial, cases.names, sweep.columns, sweep.rows())
            partial.replace(args.directory / "table.csv")
            sweep.discard_journal()
    except Interrupted as interrupted:
        sys.stderr.write(f"{interrupted}\n")
        return 130
    except OrchestratorError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
    return 0


if __name__ == "__main__":
    sys.exit(main())
