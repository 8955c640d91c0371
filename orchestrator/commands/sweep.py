"""``sweep``: many sizes, noise levels and seeds of the paired loops; or any scenario over any parameters."""

import argparse
from pathlib import Path

from orchestrator.api.cases import DEFAULT_SAMPLES, RunOptions
from orchestrator.api.scenario_sweep import ScenarioSweepResult, sweep_scenario
from orchestrator.api.sweep import SweepResult, sweep
from orchestrator.commands._console import print_blocks, say
from orchestrator.commands._experiment import add_experiment_arguments, refuse_with_scenario
from orchestrator.commands._parser import numbers_of, options_for
from orchestrator.commands._progress import CaseProgress, add_engine_arguments
from orchestrator.commands._trust import add_trust, note_missing_walls
from orchestrator.engine import choose_tls
from orchestrator.shared.output import stage_output

# Where and how a sweep ran does not change what it found.
NOT_PART_OF_THE_RESULT = frozenset(
    {"run", "command", "out", "resume", "workers", "scheduler", "tls_ca", "tls_cert", "tls_key"}
)
PAIR_DEFAULTS: dict[str, object] = {"sizes": "random:20", "noise": "0,1e-4", "seeds": 1, "settings": None}
# What `--scenario` leaves without a meaning.
PAIR_ONLY = frozenset({"experiment", "backlash_model", *PAIR_DEFAULTS})


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a sweep takes."""
    add_experiment_arguments(parser)
    usual = PAIR_DEFAULTS | {"seed": 0}
    for name, kind, metavar, text in (
        ("sizes", str, "SPEC", "half-gaps [rad]: 0.01,0.02 or range:LOW:HIGH:N or logrange:LOW:HIGH:N or random:N"),
        ("noise", str, "LIST", "encoder noise [rad]"),
        ("seeds", int, "N", "runs of each size and noise level"),
        ("seed", int, "N", "seed of random sizes and of all noise"),
    ):
        told = f"{text} (default: %(default)s)"
        parser.add_argument(f"--{name}", type=kind, default=usual[name], metavar=metavar, help=told)
    text = "also vary a parameter, such as plant.J_l=range:5.3:5.9:5; also list, logrange, random, sobol"
    parser.add_argument("--vary", action="append", default=[], metavar="NAME=SPEC", help=text)
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="sweep this TOML scenario instead of the pair")
    text = f"number of draws for random and sobol in --vary (default: {DEFAULT_SAMPLES})"
    parser.add_argument("--samples", type=int, metavar="N", help=text)
    parser.add_argument("--settings", type=Path, metavar="FILE.toml", help="changed settings of the calibration")
    parser.add_argument("--parquet", action="store_true", help="also write the table as Parquet (extra [parquet])")
    add_engine_arguments(parser)
    add_trust(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the sweep, print the table, write the results; 1 when a case failed."""
    if arguments.scenario is not None:
        refuse_with_scenario(arguments, PAIR_DEFAULTS)
    unused = NOT_PART_OF_THE_RESULT | (PAIR_ONLY if arguments.scenario is not None else frozenset())
    given = {name: value for name, value in vars(arguments).items() if name not in unused}
    if arguments.settings is not None:
        given["settings"] = str(arguments.settings)
    with stage_output(arguments.out) as folder:
        with CaseProgress("sweep") as progress:
            result = _sweep(arguments, progress)
        with result:
            result.write(folder, arguments.out, given)
            blocks, failed = result.blocks(), result.failed
    print_blocks(blocks)
    result.sweep.discard_journal()
    figures = ", sweep.png" if arguments.scenario is None else ""
    print_blocks([f"Written to {arguments.out}: report.html, sweep.csv, sweep.json{figures}"])
    return 1 if failed else 0


def _sweep(arguments: argparse.Namespace, progress: CaseProgress) -> SweepResult | ScenarioSweepResult:
    options = RunOptions(
        **options_for(RunOptions, arguments),
        journal=arguments.out / "sweep.journal",
        progress=progress.update,
        tls=choose_tls(arguments.tls_ca, arguments.tls_cert, arguments.tls_key),
    )
    if arguments.scenario is not None:
        if not arguments.trust:
            note_missing_walls()
        return sweep_scenario(**options_for(sweep_scenario, arguments), options=options)
    return sweep(
        **options_for(sweep, arguments) | {"noise": numbers_of("--noise", arguments.noise)}, options=options, tell=say
    )
