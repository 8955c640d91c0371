"""``ssp export``: systems as SSP files. ``ssp run``: any SSP of co-simulation FMUs under our master."""

import argparse
from collections.abc import Mapping
from pathlib import Path

from orchestrator.api.simulate import run_ssp
from orchestrator.api.ssp import VERSIONS, export_ssp
from orchestrator.commands._console import print_blocks
from orchestrator.commands._parser import options_for
from orchestrator.commands._safety import add_safety_arguments, safety_of
from orchestrator.commands._trust import note
from orchestrator.errors import ScenarioError
from orchestrator.reporting import write_report
from orchestrator.shared.output import stage_output, write_result

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
    parser.add_argument(
        "--ssp-version", dest="version", choices=VERSIONS, default="1.0", help="export: of SSP (default: %(default)s)"
    )
    parser.add_argument("--step", type=float, metavar="S", help="run: communication step (default: the file's own)")
    parser.add_argument("--stop", type=float, metavar="S", help="run: stop time (default: the file's own)")
    parser.add_argument("--jacobi", action="store_true", help="run: step all FMUs in parallel, as most SSP tools do")
    parser.add_argument(
        "--no-events", dest="events", action="store_false", help="run: do not use event mode of FMI 3.0 FMUs"
    )
    parser.add_argument(
        "--input", action="append", default=[], metavar="NAME=VALUE", help="run: constant value of an outer input"
    )
    add_safety_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write or run an SSP file."""
    return _export(arguments) if arguments.action == "export" else _run(arguments)


def _export(arguments: argparse.Namespace) -> int:
    if arguments.file is not None:
        raise ScenarioError(f"`ssp export` must be given a scenario by --scenario, but is given {arguments.file}")
    _refuse(arguments, "`ssp export`", {"step": None, "stop": None, "jacobi": False, "events": True, "input": []})
    if arguments.scenario is not None:
        _refuse(arguments, "`ssp export --scenario`", PAIR)
    name = "paired.ssp" if arguments.scenario is None else f"{arguments.scenario.stem}.ssp"
    with stage_output(arguments.out) as folder:
        written = export_ssp(folder / name, **options_for(export_ssp, arguments))
        write_result(folder, "ssp", _words(arguments), None, written.results())
        write_report(folder, "ssp")
    print_blocks([f"Written to {arguments.out / name}: {written.counts}"])
    return 0


def _run(arguments: argparse.Namespace) -> int:
    if arguments.scenario is not None:
        raise ScenarioError("`--scenario` must be left out of `ssp run`; `simulate --scenario` runs scenarios")
    _refuse(arguments, "`ssp run`", {**PAIR, "version": "1.0"})
    if arguments.file is None:
        raise ScenarioError("`ssp run` must be given an SSP file, but is given none")
    with stage_output(arguments.out) as folder:
        given = options_for(run_ssp, arguments) | {"inputs": _inputs(arguments.input)}
        result = run_ssp(arguments.file, **given, safety=safety_of(arguments), tell=note)
        result.write(folder, arguments.out, _words(arguments))
    print_blocks(result.blocks())
    print_blocks([f"Written to {arguments.out}: ssp.csv, ssp.json"])
    return 0


def _refuse(arguments: argparse.Namespace, action: str, defaults: Mapping[str, object]) -> None:
    for name, default in defaults.items():
        if getattr(arguments, name) != default:
            flag = {"version": "ssp-version", "events": "no-events"}.get(name, name)
            raise ScenarioError(f"`--{flag}` must be left out of {action}, which it does not change")


def _inputs(words: list[str]) -> dict[str, float]:
    inputs: dict[str, float] = {}
    for word in words:
        name, _, text = word.rpartition("=")
        try:
            inputs[name] = float(text)
        except ValueError:
            raise ScenarioError(f"`--input` must be NAME=NUMBER, but is {word!r}") from None
    return inputs


def _words(arguments: argparse.Namespace) -> dict[str, object]:
    names = ("action", "file", "scenario", "alpha", "reference", "version", "step", "stop", "jacobi", "events")
    return {
        name: str(value) if isinstance(value, Path) else value
        for name, value in vars(arguments).items()
        if name in names
    }
