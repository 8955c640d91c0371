"""``bench``: masters on the same FMUs and the same scenario, as ratios measured in one run."""

import argparse
import sys
from dataclasses import asdict

from orchestrator.bench.job import job_of
from orchestrator.bench.measure import Row, compare
from orchestrator.bench.scaling import scaling
from orchestrator.bench.tools import TOOLS
from orchestrator.commands._console import print_table
from orchestrator.errors import ScenarioError
from orchestrator.fmi.build import ensure_built
from orchestrator.output import staged, write_result
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.reporting import write_report
from orchestrator.ssp.pair import paired_scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the benchmark takes."""
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="turns that every tool gets (default: 3)")
    parser.add_argument(
        "--tools", default=",".join(TOOLS), metavar="A,B", help="which tools (default: all, installed or not)"
    )
    parser.add_argument("--scaling", action="store_true", help="also cost against number of FMUs and of steps")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print the tables, write JSON."""
    tools = [name.strip() for name in arguments.tools.split(",")]
    unknown = [name for name in tools if name not in TOOLS]
    if unknown:
        raise ScenarioError(f"`--tools` must be among {', '.join(TOOLS)}, but has {unknown[0]!r}")
    if not 1 <= arguments.rounds <= 1000:
        raise ScenarioError(f"`--rounds` must lie in [1, 1000], but is {arguments.rounds}")
    fmus = ensure_built(FMUS)
    job = job_of(paired_scenario(Experiment(), fmus, 0.02, 0.5))
    with staged(arguments.out) as directory:
        rows = compare(job, tools, arguments.rounds, _say)
        base = next((row for row in rows if row.wall is not None), None)
        title = f"{len(job.fmus)} FMUs, {job.steps} steps of {job.step:g} s, medians of {3 * arguments.rounds} runs"
        head = ("tool", "version", "scheme", "wall [ms]", "cpu [ms]", "us per step", "wall ratio", "cpu ratio", "note")
        print_table(title, head, [_cells(row, base, job.steps) for row in rows])
        costs = scaling(fmus["Drivetrain"], progress=_say) if arguments.scaling else []
        if costs:
            cells = [[str(c.fmus), f"{c.steps:,}", f"{c.microseconds:.2f}"] for c in costs]
            print_table("cost of this master", ("FMUs", "steps", "us per FMU and step"), cells)
        results = {"rows": [asdict(row) for row in rows], "scaling": [asdict(c) for c in costs]}
        write_result(directory, "bench", {"rounds": arguments.rounds, "tools": tools}, None, results)
        write_report(directory, "bench")
    sys.stdout.write(f"Ratios: {base.title if base else 'nothing'} over the row's tool. Written to {arguments.out}\n")
    return 0


def _say(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")


def _cells(row: Row, base: Row | None, steps: int) -> list[str]:
    version = "" if row.version is None else row.version
    if row.wall is None or row.cpu is None or base is None or base.wall is None or base.cpu is None:
        return [row.title, version, row.scheme, "", "", "", "", "", row.note]
    numbers = [f"{1e3 * row.wall:.1f}", f"{1e3 * row.cpu:.1f}", f"{1e6 * row.cpu / steps:.1f}"]
    return [
        row.title,
        version,
        row.scheme,
        *numbers,
        f"{base.wall / row.wall:.2f}",
        f"{base.cpu / row.cpu:.2f}",
        row.note,
    ]
