"""``ssp export``: systems as SSP 1.0 files. ``ssp run``: any SSP of FMI 2.0 co-simulation FMUs under our master."""

import argparse
import csv
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from orchestrator.commands._console import print_table
from orchestrator.errors import ScenarioError
from orchestrator.fmi.build import ensure_built
from orchestrator.master.result import Result
from orchestrator.master.signals import Constant, Signal
from orchestrator.output import staged, write_result
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.reporting import write_report
from orchestrator.scenario import load_scenario, simulate
from orchestrator.ssp.pair import paired_scenario
from orchestrator.ssp.read import opened_ssp
from orchestrator.ssp.write import write_ssp

ACTIONS = ("export", "run")
PAIR = {"alpha": 0.02, "reference": 0.5}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what both actions take."""
    parser.add_argument("action", choices=ACTIONS, help="export: write an SSP file; run: simulate one")
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE.ssp", help="run: the SSP file")
    parser.add_argument(
        "--scenario", type=Path, metavar="FILE", help="export: this TOML scenario (default: the paired loops)"
    )
    parser.add_argument(
        "--alpha", type=float, default=0.02, metavar="RAD", help="export: half-gap (default: %(default)s)"
    )
    parser.add_argument(
        "--reference", type=float, default=0.5, metavar="RAD", help="export: wanted load angle (default: %(default)s)"
    )
    parser.add_argument("--step", type=float, metavar="S", help="run: communication step (default: the file's own)")
    parser.add_argument("--stop", type=float, metavar="S", help="run: stop time (default: the file's own)")
    parser.add_argument("--jacobi", action="store_true", help="run: all FMUs side by side, as most SSP tools do")
    parser.add_argument(
        "--input", action="append", default=[], metavar="NAME=VALUE", help="run: constant value of an outer input"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write or run an SSP file."""
    return _export(arguments) if arguments.action == "export" else _run(arguments)


def _export(arguments: argparse.Namespace) -> int:
    if arguments.file is not None:
        raise ScenarioError(f"`ssp export` must be given a scenario by --scenario, but is given {arguments.file}")
    _refuse(arguments, "`ssp export`", {"step": None, "stop": None, "jacobi": False, "input": []})
    if arguments.scenario is None:
        scenario = paired_scenario(Experiment(), ensure_built(FMUS), arguments.alpha, arguments.reference)
    else:
        _refuse(arguments, "`ssp export --scenario`", PAIR)
        scenario = load_scenario(arguments.scenario)
    name = "paired.ssp" if arguments.scenario is None else f"{arguments.scenario.stem}.ssp"
    with staged(arguments.out) as directory:
        write_ssp(directory / name, scenario)
        results = {
            "file": name,
            "components": [i.name for i in scenario.system.instances],
            "connections": len(scenario.system.connections),
            "stop": scenario.stop,
            "step": scenario.algorithm.step,
        }
        write_result(directory, "ssp", _words(arguments), None, results)
        write_report(directory, "ssp")
    counts = f"{len(scenario.system.instances)} FMUs, {len(scenario.system.connections)} connections"
    sys.stdout.write(f"Written to {arguments.out / name}: {counts}\n")
    return 0


def _run(arguments: argparse.Namespace) -> int:
    if arguments.scenario is not None:
        raise ScenarioError("`--scenario` must be left out of `ssp run`; `simulate --scenario` runs scenarios")
    _refuse(arguments, "`ssp run`", PAIR)
    if arguments.file is None:
        raise ScenarioError("`ssp run` must be given an SSP file, but is given none")
    if arguments.step is not None and not 0.0 < arguments.step < float("inf"):
        raise ScenarioError(f"`--step` must be finite and positive, but is {arguments.step!r}")
    with (
        opened_ssp(arguments.file, _inputs(arguments.input), arguments.step, arguments.jacobi) as scenario,
        staged(arguments.out) as directory,
    ):
        result = simulate(scenario if arguments.stop is None else replace(scenario, stop=arguments.stop))
        _write_csv(directory / "ssp.csv", result)
        head = ("signal", "unit", "first", "last", "smallest", "largest")
        rows = [_summary(result, name) for name in result.names]
        print_table(f"{arguments.file.name}: {len(result.time) - 1} steps", head, rows)
        signals = [dict(zip(head, row, strict=True)) for row in rows]
        write_result(directory, "ssp", _words(arguments), None, {"signals": signals, "steps": len(result.time) - 1})
        write_report(directory, "ssp")
    sys.stdout.write(f"Written to {arguments.out}: ssp.csv, ssp.json\n")
    return 0


def _refuse(arguments: argparse.Namespace, action: str, defaults: Mapping[str, object]) -> None:
    for name, default in defaults.items():
        if getattr(arguments, name) != default:
            raise ScenarioError(f"`--{name}` must be left out of {action}, which it does not change")


def _inputs(words: list[str]) -> dict[str, Signal]:
    inputs: dict[str, Signal] = {}
    for word in words:
        name, _, text = word.rpartition("=")
        try:
            inputs[name] = Constant(float(text))
        except ValueError:
            raise ScenarioError(f"`--input` must be NAME=NUMBER, but is {word!r}") from None
    return inputs


def _words(arguments: argparse.Namespace) -> dict[str, object]:
    names = ("action", "file", "scenario", "alpha", "reference", "step", "stop", "jacobi")
    return {
        name: str(value) if isinstance(value, Path) else value
        for name, value in vars(arguments).items()
        if name in names
    }


def _summary(result: Result, name: str) -> list[str]:
    values = result[name]
    numbers = (values[0], values[-1], values.min(), values.max())
    return [name, result.units.get(name) or "", *(f"{v:.6g}" for v in numbers)]


def _write_csv(path: Path, result: Result) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time", *result.names])
        for time, row in zip(result.time.tolist(), result.values.T.tolist(), strict=True):
            writer.writerow([repr(time), *map(repr, row)])
