"""The work of ``estimate``: what it shows, prints and writes."""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.api.design import DEFAULT_SIZE, RANGES, DesignResult, check_design, design
from orchestrator.api.estimable import plausible_records, require_linear
from orchestrator.api.estimate import DIAGNOSIS, EstimateResult, estimate
from orchestrator.api.locate_gap import TRAIN, complete_record, locate_gap, require_train
from orchestrator.commands._budget import Budget
from orchestrator.commands._console import next_step, print_blocks
from orchestrator.commands._parser import options_for
from orchestrator.commands._reading import tell_rates, what_was_read
from orchestrator.commands._stages import Stages, diagnosis_seconds
from orchestrator.errors import ScenarioError
from orchestrator.estimation.apply import default_method
from orchestrator.estimation.cost import fit_seconds
from orchestrator.estimation.protocol import FITTED
from orchestrator.estimation.settings import EstimationSettings
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.output import stage_output

SECONDS_OF_OTHERS = 3.0  # that a method without a fit takes
INTERRUPTED = 130  # exit code after Ctrl-C
CHEAP = 20.0  # s, from which on a word is said of a lower rate
LOW_RATE = 200.0  # Hz, which shows the shafts that the methods are made for


def estimate_or_design(
    args: argparse.Namespace,
    model: Model,
    settings: EstimationSettings,
    reading: Mapping[str, Any],
    options: Mapping[str, float],
) -> int:
    """Estimate the gap from records, design an experiment that would show it, or both."""
    require_linear(model)
    records = plausible_records(args.records, model, args.motor_only, **reading)
    tell_rates(records, args.rate)
    if args.cost:
        _tell_cost(records, model, args, settings)
        return 0
    if args.design:
        check_design(model, args.size, **options)
    with stage_output(args.out, EstimateResult.replaces) as folder:
        found: EstimateResult | None = None
        plan: DesignResult | None = None
        interrupted = False
        if records:
            budget, seconds = Budget(), _tell_cost(records, model, args, settings)
            with budget.catching(), _show_stages(records, seconds, budget) as progress:
                asked = options_for(estimate, args) | {"model": model, "settings": settings, "time_limit": _limit(args)}
                found = estimate(records, **asked, diagnose=not args.no_diagnose, progress=progress, stop=budget.why)
            interrupted = budget.interrupted
        if args.design and not interrupted:
            size = args.size if args.size is not None else _design_size(found)
            with Stages() as stages:
                plan = design(model, size, **options, motor_only=args.motor_only, progress=stages.counter("designing"))
        whole = plan if found is None else replace(found, plan=plan)
        assert whole is not None  # there are records, or a design is asked for
        whole.write(folder, args.out, _given(args), args.pictures)
    blocks = [*what_was_read(records), *whole.blocks()]
    if plan is not None and not plan.shows:
        blocks.append(
            f"No excitation within these limits shows a half-gap of {plan.size:g} rad: raise `--torque-limit`, "
            "`--speed-limit` or `--duration`"
        )
    following = next_step(found is not None and found.can_compensate, args.out / "estimate.json")
    print_blocks([*blocks, f"Written to {args.out}", *following])
    return INTERRUPTED if interrupted else 0


def locate(args: argparse.Namespace, model: Model, settings: EstimationSettings, reading: Mapping[str, Any]) -> int:
    """Say in which stage of a train the gap is."""
    for name in ("method", "motor_only", "design", "cost"):
        if getattr(args, name):
            raise ScenarioError(f"`{name}` must be left out with a {TRAIN}, but is given", name)
    if len(args.records) != 1:
        raise ScenarioError(f"`DATA` must be one record with a {TRAIN}, but is {len(args.records)}")
    require_train(model)
    record = complete_record(args.records[0], model, **reading)
    tell_rates([record], args.rate)
    with Stages() as stages:
        stages.begin("trying sizes", 0.0)
        found = locate_gap(
            record, model, time_limit=_limit(args), settings=settings,
            progress=lambda work, stage, share: stages.at(stage, share),
        )  # fmt: skip
    with stage_output(args.out, found.replaces) as folder:
        found.write(folder, args.out, _given(args), args.pictures)
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
        said += f"; a diagnosis takes about {diagnosis_seconds(rows):.0f} s more if the model explains too little"
    sys.stderr.write(said + "\n")
    return seconds


def _limit(args: argparse.Namespace) -> float:
    """Return the time limit [s], infinity without one."""
    return math.inf if args.time_limit is None else float(args.time_limit)


def _given(args: argparse.Namespace) -> dict[str, Any]:
    """Return what was asked for as ``estimate.json`` says it."""
    given = {name: _plain(value) for name, value in vars(args).items() if name not in ("run", "command", "pictures")}
    return {"record": str(args.records[0]) if args.records else None} | given


def _plain(value: Any) -> Any:
    """Return an argument as JSON holds it."""
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return str(value) if isinstance(value, Path) else value


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
