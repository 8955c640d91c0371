"""``diagnose``: where a record and the model disagree, what is missing, and the corrected FMU."""

import argparse
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from orchestrator.commands._console import next_step, print_blocks, say
from orchestrator.commands._parser import options_for
from orchestrator.commands._reading import (
    FOR_FITS,
    FORMATS,
    add_reading_arguments,
    add_settings_argument,
    reading_of,
    tell_rates,
    what_was_read,
)
from orchestrator.commands._stages import Stages, diagnosis_seconds
from orchestrator.commands._trust import note_missing_walls
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import ScenarioError
from orchestrator.shared.output import stage_output
from orchestrator.shared.settings import choose_settings
from orchestrator.shared.trust import Level


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "records", type=Path, nargs="+", metavar="DATA", help=f"measured records of one machine ({FORMATS})"
    )
    add_settings_argument(parser)
    for flag, metavar, text in (
        ("--model", "FILE.toml", "nominal model"),
        ("--fmu", "ANY.fmu", "any co-simulation FMU of FMI 2.0 or 3.0, instead of a plant of this project"),
        ("--scenario", "LOOP.toml", "several FMUs connected by a scenario, instead of one"),
        ("--map", "MAP.toml", "with an FMU: columns, uncertain parameters, ports"),
        ("--validate", "OTHER", "a second record on which to report the misfit"),
        ("--test", "OTHER", "a record to use as test data instead of the last rows"),
    ):
        parser.add_argument(flag, type=Path, metavar=metavar, help=text)
    text = "with an FMU: write a draft map.toml from its units and causality, and stop"
    parser.add_argument("--draft-map", action="store_true", help=text)
    text = "re-fit and judge the given model (a corrected.toml), without a search"
    parser.add_argument("--no-search", action="store_true", help=text)
    text = "fit exactly these effects, without a search for others; none: fit no effect"
    parser.add_argument("--effects", type=_labels, metavar="NAME@SITE,...", help=text)
    parser.add_argument(
        "--time-limit", type=float, metavar="SECONDS", help="end the search after this time, with the result so far"
    )
    add_reading_arguments(parser, FOR_FITS)


def run(args: argparse.Namespace) -> int:
    """Diagnose, print what was found, write JSON, CSV, report and the corrected FMU."""
    if args.fmu is not None or args.scenario is not None:
        return _any_fmu(args)
    if args.map is not None or args.draft_map:
        raise ScenarioError("`map` and `draft_map` must come with an FMU, but none is given", "map", "draft_map")
    settings = choose_settings(args.settings, DiagnosisSettings)
    if args.time_limit is not None and not 0.0 < args.time_limit < 1e9:
        raise ScenarioError(f"`time_limit` must be positive and below 1e9 s, but is {args.time_limit:g}", "time_limit")
    reading = reading_of(args)
    from orchestrator.records.model_file import read_model

    model = read_model(args.model)
    # Seconds of libraries, for which mistakes in flags and model file need not wait.
    from orchestrator.api.diagnose import comparable_records, diagnose
    from orchestrator.api.diagnosed import DiagnosisResult

    records = comparable_records(args.records, model, **reading)
    tell_rates(records, args.rate)
    (other,) = (None,) if args.validate is None else comparable_records([args.validate], model, **reading)
    (tested,) = (None,) if args.test is None else comparable_records([args.test], model, **reading)
    files = {"record": args.records[0], "model": args.model, "settings": args.settings, "validate": args.validate}
    files["test"] = args.test
    given = {name: path and str(path) for name, path in files.items()}
    with stage_output(args.out, DiagnosisResult.replaces) as folder:
        with _show_stages(sum(record.size for record in records)) as progress:
            asked = options_for(diagnose, args) | {"model": model, "validate": other, "test": tested}
            found = diagnose(records, **asked | {"settings": settings}, search=not args.no_search, progress=progress)
        found.write(folder, args.out, given, args.pictures)
        fmu = args.out / found.fmu_name
    print_blocks([*what_was_read(records if other is None else [*records, other]), *found.blocks()])
    use = "for any FMI 2.0 tool: variables as before, corrected values as start values"
    if found.diagnosis.trust.level is Level.RED:
        use = "which must not be used"
    print_blocks(
        [
            f"Corrected FMU: {fmu}, {use}",
            f"Its model file: {args.out / 'corrected.toml'}; `diagnose NEW.csv --no-search --model` with it judges "
            "a new record",
            f"Written to {args.out}: report.html, diagnose.json, diagnose.csv",
            *next_step(found.can_compensate, args.out / "corrected.toml"),
        ]
    )
    return 0


def _any_fmu(args: argparse.Namespace) -> int:
    """Diagnose an FMU that is not ours, or several, or draft the map."""
    if args.scenario is not None and (args.fmu is not None or args.scenario.suffix.lower() != ".toml"):
        raise ScenarioError("`scenario` must be a TOML file, without `fmu`, but is not", "scenario", "fmu")
    fmu = args.fmu if args.scenario is None else args.scenario
    for name in ("model", "part", "resample", "rate", "header"):
        if getattr(args, name) is not None:
            raise ScenarioError(f"`{name}` must be left out with an FMU of others", name)
    from orchestrator.api.any_fmu import FmuDiagnosisResult, draft_map
    from orchestrator.api.diagnose import diagnose

    note_missing_walls()
    if args.draft_map:
        text = draft_map(args.records[0], fmu)
        with stage_output(args.out) as folder:
            (folder / "map.toml").write_text(text, encoding="utf-8")
        print_blocks([f"Written to {args.out / 'map.toml'}: look it over, and give it with --map"])
        return 0
    if args.map is None:
        raise ScenarioError("`map` must be given with an FMU; `draft_map` writes a first one", "map", "draft_map")
    with stage_output(args.out, FmuDiagnosisResult.replaces) as folder:
        given = options_for(diagnose, args) | {"model": fmu, "search": not args.no_search}
        found = diagnose(args.records, **given, progress=lambda done, expected, what: say(what))
        try:
            found.write(folder, args.out, pictures=args.pictures)
        finally:
            found.close()
        print_blocks(found.blocks())
    print_blocks([f"Written to {args.out}: report.html, diagnose.json, diagnose.csv"])
    return 0


def _labels(text: str) -> tuple[str, ...]:
    """Return the labels of a list of effects; "none": no effect. A comma in brackets belongs to a name, `x[1,2]`."""
    labels = tuple(dict.fromkeys(label.strip() for label in re.split(r",(?![^\[]*\])", text)))
    if "" in labels:
        raise argparse.ArgumentTypeError(f"must be effects such as backlash@shaft, or none, but is {text!r}")
    return () if labels == ("none",) else labels


@contextmanager
def _show_stages(rows: int) -> Iterator[Callable[[int, int, str], None]]:
    """Show stages with the time left on a terminal; yield the progress callback of a diagnosis."""
    with Stages() as stages:
        stages.begin("diagnosing", diagnosis_seconds(rows))
        yield lambda done, expected, what: stages.at(f"fitted {what}", min(done / 60.0, 0.95))
