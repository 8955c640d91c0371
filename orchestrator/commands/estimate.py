"""``estimate``: the gap, with interval, from a measured record; or the excitation that would show it."""

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from orchestrator.api.arguments import choose_settings
from orchestrator.api.design import DEFAULT_SIZE, RANGES, check_design, design
from orchestrator.api.estimable import plausible_record, require_linear
from orchestrator.api.estimate import DIAGNOSIS, EstimateResult, estimate
from orchestrator.api.locate_gap import TRAIN, complete_record, locate_gap, require_train
from orchestrator.api.records import read_model
from orchestrator.api.shown import Block, write_page
from orchestrator.commands._budget import Budget
from orchestrator.commands._console import print_blocks
from orchestrator.commands._progress_lines import ProgressLines, is_for_programs
from orchestrator.commands._reading import FORMATS, add_reading_arguments, reading_of, what_was_read
from orchestrator.commands._stages import Stages, diagnosis_seconds
from orchestrator.errors import ScenarioError
from orchestrator.estimation.apply import WITHOUT_TORQUE, default_method
from orchestrator.estimation.cost import fit_seconds
from orchestrator.estimation.protocol import METHODS
from orchestrator.estimation.settings import EstimationSettings
from orchestrator.estimation.trust import FITTED
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.output import stage_output, write_result
from orchestrator.shared.results.estimate import EstimateFound


@dataclass(frozen=True)
class DesignOption:
    """A number that ``--design`` takes: its name in Python, unit, default and what it means."""

    name: str
    unit: str
    default: float
    meaning: str

    @property
    def flag(self) -> str:
        """Return the option of the command line."""
        return "--" + self.name.replace("_", "-")


DESIGN_OPTIONS = (
    DesignOption("torque_limit", "N.m", 250.0, "largest torque to ask for"),
    DesignOption("speed_limit", "RAD/S", 50.0, "largest speed of the motor"),
    DesignOption("duration", "S", 10.0, "length of the proposed record"),
    DesignOption("rate", "HZ", 200.0, "its samples per second"),
)


SECONDS_OF_OTHERS = 3.0  # that a method without a fit takes
INTERRUPTED = 130  # exit code after Ctrl-C
CHEAP = 20.0  # s, from which on a word is said of a lower rate
LOW_RATE = 200.0  # Hz, which shows the shafts that the methods are made for


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "records",
        type=Path,
        nargs="*",
        metavar="DATA",
        help=f"measured record ({FORMATS}); several of one machine are fitted together",
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FILE.toml",
        help="the model it is compared with (default: the thesis's values, 5 %% each)",
    )
    listed = "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    parser.add_argument(
        "--method",
        choices=[*METHODS, "all"],
        help=f"{listed} (default: {FITTED}; {WITHOUT_TORQUE} without a torque)",
    )
    parser.add_argument("--motor-only", action="store_true", help="leave the load encoder out")
    parser.add_argument("--time-limit", type=float, metavar="S", help="give up after this time (default: never)")
    parser.add_argument("--settings", type=Path, metavar="FILE.toml", help="thresholds, in the groups of the result")
    add_reading_arguments(parser, "; with --design also those of the proposed record (default: 200)")
    parser.add_argument(
        "--no-diagnose", action="store_true", help="stop where the model does not explain the record; name nothing"
    )
    parser.add_argument("--cost", action="store_true", help="say what the fit would take, and stop")
    group = parser.add_argument_group("design of an experiment")
    group.add_argument("--design", action="store_true", help="propose a torque record that shows the gap best")
    group.add_argument(
        "--size", type=float, metavar="RAD", help=f"half-gap to be seen (default: the estimate, or {DEFAULT_SIZE:g})"
    )
    for option in DESIGN_OPTIONS[:-1]:
        text = f"{option.meaning} (default: {option.default:g})"
        group.add_argument(option.flag, type=float, metavar=option.unit, help=text)


def run(args: argparse.Namespace) -> int:
    """Estimate or design, print tables, write JSON, CSV and report."""
    options = _design_options(args)
    model = read_model(args.model)
    if model.fmu == TRAIN:
        return _locate(args, model)
    require_linear(model)
    settings = choose_settings(args.settings, EstimationSettings)
    reading = reading_of(args)
    records = [plausible_record(path, model, args.motor_only, **reading) for path in args.records]
    if args.cost:
        _tell_cost(records, model, args, settings)
        return 0
    if args.design:
        check_design(model, args.size, **options)
    with stage_output(args.out, EstimateResult.replaces) as folder:
        results = EstimateFound()
        blocks: list[Block] = []
        found: EstimateResult | None = None
        interrupted = False
        if records:
            budget, seconds = Budget(), _tell_cost(records, model, args, settings)
            blocks += what_was_read(records)
            with budget.catching(), _show_stages(records, seconds, budget) as progress:
                found = estimate(
                    records,
                    model,
                    method=args.method,
                    motor_only=args.motor_only,
                    time_limit=math.inf if args.time_limit is None else args.time_limit,
                    diagnose=not args.no_diagnose,
                    settings=settings,
                    progress=progress,
                    stop=budget.why,
                )
            interrupted = budget.interrupted
            blocks += found.blocks()
            found.write_files(folder)
            found.write_diagnosis(folder, args.out, args.pictures)
            results = found.results(args.out)
        if args.design and not interrupted:
            size = args.size if args.size is not None else _design_size(found)
            with _progress() as advance:
                plan = design(model, size, **options, motor_only=args.motor_only, progress=advance)
            blocks += plan.blocks()
            if not plan.shows:
                blocks.append(
                    f"No excitation within these limits shows a half-gap of {size:g} rad: raise `--torque-limit`, "
                    "`--speed-limit` or `--duration`"
                )
            plan.write_files(folder)
            results = msgspec.structs.replace(results, design=plan.entries())
        given = {"record": str(args.records[0]) if args.records else None}
        given |= {k: _plain(v) for k, v in vars(args).items() if k not in ("run", "command", "pictures")}
        write_result(folder, "estimate", given, None, results)
        write_page(folder, "estimate", args.pictures)
    print_blocks([*blocks, f"Written to {args.out}"])
    return INTERRUPTED if interrupted else 0


def _locate(args: argparse.Namespace, model: Model) -> int:
    """Say in which stage of a train the gap is."""
    for name in ("method", "motor_only", "design", "cost"):
        if getattr(args, name):
            raise ScenarioError(f"`{name}` must be left out with a {TRAIN}, but is given", name)
    if len(args.records) != 1:
        raise ScenarioError(f"`DATA` must be one record with a {TRAIN}, but is {len(args.records)}")
    settings = choose_settings(args.settings, EstimationSettings)
    require_train(model)
    record = complete_record(args.records[0], model, **reading_of(args))
    limit = math.inf if args.time_limit is None else args.time_limit
    with Stages() as stages:
        stages.begin("trying sizes", 0.0)
        found = locate_gap(
            record,
            model,
            time_limit=limit,
            settings=settings,
            progress=lambda work, stage, share: stages.at(stage, share),
        )
    given = {name: _plain(value) for name, value in vars(args).items() if name not in ("run", "command", "pictures")}
    with stage_output(args.out, found.replaces) as folder:
        found.write(folder, args.out, {"record": str(args.records[0])} | given, args.pictures)
    print_blocks([*what_was_read([record]), *found.blocks(), f"Written to {args.out}"])
    return 0


def _tell_cost(records: list[Record], model: Model, args: argparse.Namespace, settings: EstimationSettings) -> float:
    """Say what a fit will cost before it starts, and return its processor time [s]; 0.0 where nothing is fitted."""
    fitted = (args.method or default_method(records)) in (FITTED, "all")
    if not fitted or not all(record.has_torque for record in records):
        return 0.0
    rows = sum(record.size for record in records)
    seconds = fit_seconds(records, model, settings)
    rate = 1.0 / records[0].step
    said = f"The fit of {rows} rows will take about {seconds:.0f} s of processor time"
    if rate > LOW_RATE and seconds > CHEAP:
        said += f" (with --rate {LOW_RATE:g} {seconds * LOW_RATE / rate:.0f} s)"
    if not args.no_diagnose:
        said += f"; a diagnosis, where the model does not explain the record, {diagnosis_seconds(rows):.0f} s more"
    sys.stderr.write(said + "\n")
    return seconds


def _plain(value: Any) -> Any:
    """Return an argument as JSON holds it."""
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value


def _design_options(args: argparse.Namespace) -> dict[str, float]:
    """Return the value of each of ``DESIGN_OPTIONS``, by name; refuse options that would have no effect."""
    if args.time_limit is not None and not args.time_limit > 0.0:
        raise ScenarioError(f"`time_limit` must be positive, but is {args.time_limit:g}", "time_limit")
    if not args.records:
        if not args.design:
            raise ScenarioError("`DATA` must be given, unless `--design` is, but neither is")
        if args.method is not None:
            raise ScenarioError("`--method` must come with a record, but none is given")
    if not args.design:
        for name in ("size", *(option.name for option in DESIGN_OPTIONS[:-1])):
            if getattr(args, name) is not None:
                raise ScenarioError(f"`{name}` must come with `design`, but that is not given", name, "design")
    given = {option.name: getattr(args, option.name) for option in DESIGN_OPTIONS}
    return {
        option.name: option.default if given[option.name] is None else given[option.name] for option in DESIGN_OPTIONS
    }


def _design_size(estimate: EstimateResult | None) -> float:
    """Return the half-gap [rad] to design for: the one that the record shows, if any."""
    shown = [e.alpha for e in (estimate.estimates if estimate is not None else ()) if e.visible and e.alpha > 0.0]
    least, most = RANGES["size"]
    return min(max(shown[0], least), most) if shown else DEFAULT_SIZE


@contextmanager
def _show_stages(records: list[Record], seconds: float, budget: Budget) -> Iterator[Callable[[str, str, float], None]]:
    """Show stages with the time left on a terminal, each in its budget; yield what is to be called at each."""
    rows = sum(record.size for record in records)
    with Stages() as stages:
        stages.begin("preparing", seconds)
        budget.begin(seconds or math.inf)
        known = [FITTED]

        def show(work: str, stage: str, share: float) -> None:
            if work not in known:
                known.append(work)
                diagnosed = work == DIAGNOSIS
                expected = diagnosis_seconds(rows) if diagnosed else SECONDS_OF_OTHERS
                stages.begin(stage, expected)
                budget.begin(expected if diagnosed else math.inf, at_once=diagnosed)
            stages.at(stage, share)

        yield show


@contextmanager
def _progress() -> Iterator[Callable[[int, int], None]]:
    """Show a bar on a terminal; yield what is to be called with the pieces of work done, and all."""
    console, lines = Console(file=sys.stderr), ProgressLines()
    columns = (TextColumn("designing"), BarColumn(), MofNCompleteColumn())
    hidden = is_for_programs() or not console.is_terminal
    with Progress(*columns, console=console, disable=hidden, transient=True) as bar:
        task = bar.add_task("", total=None)

        def advance(done: int, total: int) -> None:
            bar.advance(task)
            lines.tell("designing", done / total if total else None, None)

        yield advance
