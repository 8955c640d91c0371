"""``bench``: masters on the same FMUs and the same scenario, as ratios measured in one run."""

import argparse
import shutil
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from orchestrator.bench.alone import CASE_STEPS, RECORD_STEPS, RecordCost, SweepCost, growth
from orchestrator.bench.measure import Row, compare
from orchestrator.bench.of_scenario import job_of
from orchestrator.bench.scaling import Cost, scaling
from orchestrator.bench.tools import TOOLS
from orchestrator.commands._console import print_table
from orchestrator.errors import ScenarioError
from orchestrator.fmi.build import ensure_built
from orchestrator.output import staged, write_result
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.reporting import write_report
from orchestrator.ssp.pair import paired_scenario

WATCHED = ("plant.theta_l", "twin_plant.theta_l")
NUMBERS = ("wall [ms]", "cpu [ms]", "us per step", "wall ratio", "cpu ratio", "deviation [rad]")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the benchmark takes."""
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="turns that every tool gets (default: 3)")
    parser.add_argument(
        "--tools", default=",".join(TOOLS), metavar="A,B", help="which tools (default: all, installed or not)"
    )
    parser.add_argument(
        "--python",
        action="append",
        default=[],
        metavar="TOOL=PATH",
        help="run this tool with another interpreter, since some cannot share an environment; may be repeated",
    )
    parser.add_argument("--scaling", action="store_true", help="also cost against FMUs, steps, cases; memory")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print the tables, write JSON."""
    tools = [name.strip() for name in arguments.tools.split(",")]
    unknown = [name for name in tools if name not in TOOLS]
    if unknown:
        raise ScenarioError(f"`--tools` must be among {', '.join(TOOLS)}, but has {unknown[0]!r}")
    if not 1 <= arguments.rounds <= 1000:
        raise ScenarioError(f"`--rounds` must lie in [1, 1000], but is {arguments.rounds}")
    pythons = _interpreters(arguments.python)
    fmus = ensure_built(FMUS)
    job = job_of(paired_scenario(Experiment(), fmus, 0.02, 0.5), WATCHED)
    with staged(arguments.out) as directory:
        rows = compare(job, tools, arguments.rounds, pythons, _say)
        base = next((row for row in rows if row.wall is not None), None)
        title = f"{len(job.fmus)} FMUs, {job.steps} steps of {job.step:g} s, medians of {3 * arguments.rounds} runs"
        head = ("tool", "version", "scheme", *NUMBERS, "note")
        print_table(title, head, [_cells(row, base, job.steps) for row in rows])
        results: dict[str, Any] = {"rows": [asdict(row) for row in rows], "scaling": [], "sweeps": [], "records": []}
        if arguments.scaling:
            costs = scaling(fmus["Drivetrain"], progress=_say)
            sweeps, records = growth(_say)
            _print_scaling(costs, sweeps, records)
            results["scaling"] = [asdict(c) for c in costs]
            results |= {"sweeps": [asdict(s) for s in sweeps], "records": [asdict(r) for r in records]}
        write_result(directory, "bench", {"rounds": arguments.rounds, "tools": tools}, None, results)
        write_report(directory, "bench")
    sys.stdout.write(f"Ratios: {base.title if base else 'nothing'} over the row's tool. Written to {arguments.out}\n")
    return 0


def _say(text: str) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r\x1b[K{text}")


def _print_scaling(costs: Sequence[Cost], sweeps: Sequence[SweepCost], records: Sequence[RecordCost]) -> None:
    cells = [[str(c.fmus), f"{c.steps:,}", f"{c.microseconds:.2f}"] for c in costs]
    print_table("cost of this master", ("FMUs", "steps", "us per FMU and step"), cells)
    title = f"sweeps of six FMUs, {CASE_STEPS} steps a case, one worker"
    cells = [[f"{s.cases:,}", f"{s.total:.1f}", f"{1e3 * s.per_case:.2f}", f"{s.peak:.0f}"] for s in sweeps]
    print_table(title, ("cases", "in all [s]", "one more case [ms]", "peak memory [MiB]"), cells)
    cells = [[str(r.signals), f"{r.growth:.1f}", f"{r.expected:.1f}"] for r in records]
    print_table(f"memory of {RECORD_STEPS:,} steps", ("recorded signals", "added [MiB]", "8 bytes each [MiB]"), cells)


def _interpreters(words: Sequence[str]) -> dict[str, str]:
    pythons = {}
    for word in words:
        tool, _, path = word.partition("=")
        if tool not in TOOLS or not path:
            raise ScenarioError(f"`--python` must be TOOL=PATH with a tool among {', '.join(TOOLS)}, but is {word!r}")
        if shutil.which(path) is None:
            raise ScenarioError(f"`--python {tool}` must name an interpreter, but there is no program {path!r}")
        pythons[tool] = path
    return pythons


def _cells(row: Row, base: Row | None, steps: int) -> list[str]:
    names = [row.title, row.version or "", row.scheme]
    if row.wall is None or base is None or base.wall is None:
        return [*names, *[""] * len(NUMBERS), row.note]
    cpu, ratio = "", ""
    if row.cpu is not None and base.cpu is not None:
        cpu, ratio = f"{1e3 * row.cpu:.1f}", f"{base.cpu / row.cpu:.2f}"
    step = 1e6 * (row.wall if row.cpu is None else row.cpu) / steps
    deviation = "" if row.deviation is None else f"{row.deviation:.1g}"
    return [
        *names,
        f"{1e3 * row.wall:.1f}",
        cpu,
        f"{step:.1f}",
        f"{base.wall / row.wall:.2f}",
        ratio,
        deviation,
        row.note,
    ]
