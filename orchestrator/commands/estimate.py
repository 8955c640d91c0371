"""``estimate``: the gap, with interval, from a measured record; or the excitation that would show it."""

import argparse
import csv
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from orchestrator.commands._console import print_table
from orchestrator.errors import ConvergenceError, ScenarioError
from orchestrator.estimation import cramer_rao
from orchestrator.estimation.design import LONGEST, SHORTEST, Limits, design
from orchestrator.estimation.protocol import LEVEL, METHODS, Estimate, NotApplicableError, estimator
from orchestrator.estimation.tables import write_tables
from orchestrator.model_file import Model, read_model
from orchestrator.output import staged, write_result
from orchestrator.record import MINIMUM_ROWS, Record, read_record
from orchestrator.record_plausibility import LONGEST_STEP, check_plausible, own_frequency
from orchestrator.reporting import write_report


@dataclass(frozen=True)
class DesignOption:
    """A number that ``--design`` takes: flag, unit, default, range and what it means."""

    flag: str
    unit: str
    default: float
    least: float
    most: float
    meaning: str


DEFAULT_METHOD = "maximum_likelihood"
DEFAULT_SIZE = 0.005  # rad
SIZES = (1e-5, 0.5)  # rad, half-gaps that a record can be designed for
DESIGN_OPTIONS = (
    DesignOption("--torque-limit", "N.m", 250.0, 1e-3, 1e6, "largest torque to ask for"),
    DesignOption("--speed-limit", "RAD/S", 50.0, 1e-3, 1e5, "largest speed of the motor"),
    DesignOption("--duration", "S", 10.0, SHORTEST, 1e4, "length of the proposed record"),
    DesignOption("--rate", "HZ", 200.0, 1.0, 1e5, "its samples per second"),
)
UNSEEN = 1.0  # rad, bound from which on a record says nothing
HEAD = ("method", "half-gap [rad]", "standard error", "Cramer-Rao", "95 % interval", "s")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "record", type=Path, nargs="?", metavar="DATA.csv", help="measured record: time,u,theta_m[,theta_l]"
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FILE.toml",
        help="the model it is compared with (default: the thesis's values, 5 %% each)",
    )
    listed = "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    parser.add_argument("--method", choices=[*METHODS, "all"], help=f"{listed} (default: {DEFAULT_METHOD})")
    parser.add_argument("--motor-only", action="store_true", help="leave the load encoder out")
    group = parser.add_argument_group("design of an experiment")
    group.add_argument("--design", action="store_true", help="propose a torque record that shows the gap best")
    group.add_argument(
        "--size", type=float, metavar="RAD", help=f"half-gap to be seen (default: the estimate, or {DEFAULT_SIZE:g})"
    )
    for option in DESIGN_OPTIONS:
        text = f"{option.meaning} (default: {option.default:g})"
        group.add_argument(option.flag, type=float, metavar=option.unit, help=text)


def run(args: argparse.Namespace) -> int:
    """Estimate or design, print tables, write JSON, CSV, figures and report."""
    options = _design_options(args)
    model = read_model(args.model)
    _require_linear(model)
    record = None if args.record is None else _read(args, model)
    if args.design:
        _require_rate(options["--rate"], model)
    with staged(args.out) as directory:
        results: dict[str, Any] = {}
        estimates: list[Estimate] = []
        if record is not None:
            method = args.method or DEFAULT_METHOD
            estimates, results = _estimate(record, model, list(METHODS) if method == "all" else [method])
            _draw(directory, record, estimates, model)
        if args.design:
            seen = next((e.alpha for e in estimates if e.visible and e.alpha > 0.0), DEFAULT_SIZE)
            size = args.size if args.size is not None else min(max(seen, SIZES[0]), SIZES[-1])
            results["design"] = _design(directory, options, model, size, args.motor_only)
        given = {k: str(v) if isinstance(v, Path) else v for k, v in vars(args).items() if k not in ("run", "command")}
        write_result(directory, "estimate", given, None, results)
        write_report(directory, "estimate")
    sys.stdout.write(f"Written to {args.out}\n")
    return 0


def _design_options(args: argparse.Namespace) -> dict[str, float]:
    """Return the value of each of ``DESIGN_OPTIONS``, by flag; refuse options that would have no effect.

    Raises:
        ScenarioError: an option is out of its range, or given where nothing reads it.
    """
    if args.record is None:
        if not args.design:
            raise ScenarioError("`DATA.csv` must be given, unless `--design` is, but neither is")
        if args.method is not None:
            raise ScenarioError("`--method` must come with a record, but none is given")
    values = {"--size": (args.size, *SIZES)}
    values |= {o.flag: (getattr(args, o.flag[2:].replace("-", "_")), o.least, o.most) for o in DESIGN_OPTIONS}
    for flag, (value, least, most) in values.items():
        if value is None:
            continue
        if not args.design:
            raise ScenarioError(f"`{flag}` must come with `--design`, but that is not given")
        if not least <= value <= most:
            raise ScenarioError(f"`{flag}` must be between {least:g} and {most:g}, but is {value:g}")
    chosen = {o.flag: o.default if values[o.flag][0] is None else values[o.flag][0] for o in DESIGN_OPTIONS}
    rows = chosen["--duration"] * chosen["--rate"]
    if not MINIMUM_ROWS <= round(rows) <= LONGEST:
        raise ScenarioError(f"`--duration` times `--rate` must be {MINIMUM_ROWS} to {LONGEST} samples, but is {rows:g}")
    return chosen


def _require_rate(rate: float, model: Model) -> None:
    own = own_frequency(model)
    if rate * LONGEST_STEP < own:
        raise ScenarioError(
            f"`--rate` must be at least {own / LONGEST_STEP:.3g} to show a shaft that oscillates at {own:.3g} rad/s, "
            f"but is {rate:g}"
        )


def _read(args: argparse.Namespace, model: Model) -> Record:
    """Return the record, which must fit the model at all."""
    record = read_record(args.record, model.columns)
    record = record.without_load_encoder() if args.motor_only else record
    check_plausible(record, model)
    return record


def _require_linear(model: Model) -> None:
    """Refuse models that the estimators would not see whole."""
    if model.fmu != "Drivetrain":
        raise ScenarioError(f"{model.source}: `fmu` must be Drivetrain to have a gap, but is {model.fmu}")
    for name, entry in model.parameters.items():
        active = name.startswith("effects.") and name.rsplit(".", 1)[1] in (
            "delay", "amplitude", "coulomb", "breakaway", "cubic", "coefficient", "inertia"
        )  # fmt: skip
        active = active or (name.startswith("effects.coulomb") and name.endswith("torque"))
        if active and (entry.value != 0.0 or entry.uncertainty > 0.0):
            raise ScenarioError(
                f"{model.source}: `estimate` fits the plant without nonlinear effects, but `{name}` is "
                f"{entry.value:g}; `diagnose` fits the gap together with them"
            )


def _estimate(record: Record, model: Model, names: list[str]) -> tuple[list[Estimate], dict[str, Any]]:
    """Run the methods, print their table and messages, and return estimates and results."""
    estimates: list[Estimate] = []
    rows: list[list[str]] = []
    table: dict[str, Any] = {}
    with _progress(len(names)) as advance:
        for name in names:
            begun = time.perf_counter()
            try:
                with np.errstate(all="ignore"):
                    estimate = estimator(name)(record, model)
                    bound = _bound(record, model, [*estimates, estimate])
            except np.linalg.LinAlgError as error:
                raise ConvergenceError(
                    f"{record.source}: `{name}` finds no solution for this record: {error}"
                ) from None
            except NotApplicableError as error:
                rows.append([name, "not applicable", "", "", str(error), ""])
                table[name] = {"not_applicable": str(error)}
            else:
                estimates.append(estimate)
                seconds = time.perf_counter() - begun
                rows.append(_row(estimate, bound, seconds))
                table[name] = _entry(estimate, bound, seconds)
            advance()
    length = f"{record.duration:g} s at {1.0 / record.step:g} Hz"
    print_table(f"{record.source}: {length}, {'one encoder' if record.theta_l is None else 'two encoders'}", HEAD, rows)
    for estimate in estimates:
        if estimate.message:
            sys.stdout.write(f"{estimate.method}: {estimate.message}\n")
    results: dict[str, Any] = {"record": {"rows": record.size, "step": record.step, "source": record.source}}
    results["estimates"] = table
    if estimates:
        results |= table[estimates[0].method] | {"method": estimates[0].method}
    return estimates, results


def _bound(record: Record, model: Model, estimates: list[Estimate]) -> float:
    """Return the record's Cramer-Rao bound: at the fit of the likelihood, or else at the newest estimate."""
    for estimate in estimates:
        if "cramer_rao" in estimate.diagnostics:
            return float(estimate.diagnostics["cramer_rao"])
    bound = cramer_rao.bound_at(record, model, estimates[-1].alpha)
    return bound if bound < UNSEEN else math.inf


def _row(estimate: Estimate, bound: float, seconds: float) -> list[str]:
    low, high = estimate.interval
    numbers = [f"{estimate.alpha:.6g}", f"{estimate.standard_error:.2g}", f"{bound:.2g}"]
    return [estimate.method, *numbers, f"{low:.6g} to {high:.6g}", f"{seconds:.1f}"]


def _entry(estimate: Estimate, bound: float, seconds: float) -> dict[str, Any]:
    return {
        "alpha": estimate.alpha,
        "standard_error": estimate.standard_error,
        "cramer_rao": bound,
        "interval": list(estimate.interval),
        "level": LEVEL,
        "unit": "rad",
        "visible": estimate.visible,
        "message": estimate.message,
        "seconds": seconds,
        "diagnostics": dict(estimate.diagnostics),
    }


def _draw(directory: Path, record: Record, estimates: list[Estimate], model: Model) -> None:
    from orchestrator.estimation.figures import draw_fit, draw_online, draw_profile

    for estimate in estimates:
        if estimate.method == "maximum_likelihood":
            fitted = estimate.diagnostics["parameters"].get("i", {}).get("value", model.parameters["i"].value)
            draw_fit(directory / "estimate_fit.png", record, estimate, fitted)
            write_tables(directory, record, [estimate], fitted)
            limit = estimate.diagnostics["profile_limit"]
            draw_profile(directory / "estimate_profile.png", estimate.curves["profile"], estimate, limit)
        elif estimate.method == "ekf":
            draw_online(directory / "estimate_online.png", record, estimate)
            write_tables(directory, record, [estimate], model.parameters["i"].value)


def _design(
    directory: Path, options: dict[str, float], model: Model, size: float, motor_only: bool
) -> list[dict[str, Any]]:
    """Choose an excitation, print the candidates, write the record to run."""
    from orchestrator.estimation.figures import draw_design

    limits = Limits(options["--torque-limit"], options["--speed-limit"])
    duration, rate = options["--duration"], options["--rate"]
    with _progress(None) as advance:
        grid, candidates = design(model, size, limits, duration, rate, motor_only, lambda done, total: advance())
    rows = [
        [c.name, f"{c.bound:.2g}" if c.bound < UNSEEN else "not seen", f"{c.torque:.4g}", f"{c.speed:.4g}"]
        for c in candidates
    ]
    head = ("excitation", "bound on the half-gap [rad]", "peak torque [N.m]", "peak motor speed [rad/s]")
    print_table(f"To see a half-gap of {size:g} rad in {duration:g} s", head, rows)
    if candidates[0].bound > 0.5 * size:
        sys.stdout.write(
            f"No excitation within these limits shows a half-gap of {size:g} rad: raise `--torque-limit`, "
            "`--speed-limit` or `--duration`\n"
        )
    with (directory / "design.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("time", "u"))
        writer.writerows((f"{t:.9g}", f"{u:.6g}") for t, u in zip(grid.tolist(), candidates[0].u.tolist(), strict=True))
    draw_design(directory / "design.png", grid, candidates[0])
    return [
        {"name": c.name, "bound": c.bound, "peak_torque": c.torque, "peak_motor_speed": c.speed}
        for c in candidates
        if c.bound < UNSEEN
    ]


@contextmanager
def _progress(total: int | None) -> Iterator[Any]:
    """Show a bar on a terminal; yield what is to be called after each piece of work."""
    console = Console(file=sys.stderr)
    columns = (TextColumn("estimating"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)
