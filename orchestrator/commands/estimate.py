"""``estimate``: the gap, with interval, from a measured record; or the excitation that would show it."""

import argparse
from pathlib import Path

from orchestrator.commands._reading import FOR_FITS, FORMATS, add_reading_arguments, add_settings_argument, reading_of
from orchestrator.errors import ScenarioError
from orchestrator.estimation.protocol import DEFAULT_SIZE, FITTED, METHODS, WITHOUT_TORQUE
from orchestrator.estimation.settings import EstimationSettings
from orchestrator.shared.settings import choose_settings

DESIGN_OPTIONS = {  # of `--design`: unit, default and meaning
    "torque_limit": ("N.m", 250.0, "largest torque to ask for"),
    "speed_limit": ("RAD/S", 50.0, "largest speed of the motor"),
    "duration": ("S", 10.0, "length of the proposed record"),
    "rate": ("HZ", 200.0, "its samples per second"),
}
OWN = ("torque_limit", "speed_limit", "duration")  # `--rate` is of reading, too


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    text = f"measured record ({FORMATS}); several of one machine are fitted together"
    parser.add_argument("records", type=Path, nargs="*", metavar="DATA", help=text)
    text = "nominal model (default: the thesis's values, 5 %% each)"
    parser.add_argument("--model", type=Path, metavar="FILE.toml", help=text)
    listed = "; ".join(f"{name}: {text}" for name, text in METHODS.items())
    text = f"{listed} (default: {FITTED}; {WITHOUT_TORQUE} without a torque)"
    parser.add_argument("--method", choices=[*METHODS, "all"], help=text)
    parser.add_argument("--motor-only", action="store_true", help="ignore the load encoder")
    parser.add_argument(
        "--time-limit", type=float, metavar="S", help="stop without a result after this time (default: never)"
    )
    add_settings_argument(parser)
    add_reading_arguments(parser, FOR_FITS, "; with --design also those of the proposed record (default: 200)")
    parser.add_argument(
        "--no-diagnose", action="store_true", help="run no diagnosis if the model does not explain the record"
    )
    parser.add_argument("--cost", action="store_true", help="print the expected time of the fit, and stop")
    group = parser.add_argument_group("design of an experiment")
    group.add_argument("--design", action="store_true", help="propose a torque record that reveals the gap best")
    group.add_argument(
        "--size", type=float, metavar="RAD", help=f"half-gap to detect (default: the estimate, or {DEFAULT_SIZE:g})"
    )
    for name in OWN:
        unit, default, text = DESIGN_OPTIONS[name]
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, type=float, metavar=unit, help=f"{text} (default: {default:g})")


def run(args: argparse.Namespace) -> int:
    """Read what is wrong without a record, then estimate or design, print tables, write JSON, CSV and report."""
    options = _design_options(args)
    settings, reading = choose_settings(args.settings, EstimationSettings), reading_of(args)
    from orchestrator.records.model_file import read_model

    model = read_model(args.model)
    from orchestrator.commands import _estimating  # seconds of libraries, for which mistakes need not wait

    if model.fmu == _estimating.TRAIN:
        return _estimating.locate(args, model, settings, reading)
    return _estimating.estimate_or_design(args, model, settings, reading, options)


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
        for name in ("size", *OWN):
            if getattr(args, name) is not None:
                raise ScenarioError(f"`{name}` must come with `design`, but that is not given", name, "design")
    given = {name: (getattr(args, name), default) for name, (_, default, _) in DESIGN_OPTIONS.items()}
    return {name: default if value is None else value for name, (value, default) in given.items()}
