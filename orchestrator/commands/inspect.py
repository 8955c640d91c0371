"""``inspect``: what is in a record, what it would show, and a model file to start from."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from orchestrator.commands._console import print_blocks
from orchestrator.commands._reading import FORMATS, add_reading_arguments, reading_of
from orchestrator.commands._stages import Stages
from orchestrator.errors import RecordError
from orchestrator.shared.output import stage_output

USUAL = 10.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("record", type=Path, metavar="DATA", help=f"measured record ({FORMATS})")
    parser.add_argument(
        "--model", type=Path, metavar="FILE.toml", help="model file of the machine, which may be incomplete"
    )
    text = "print the chosen columns, or the variables of an FMU or SSP file, as JSON, and stop"
    parser.add_argument("--columns", action="store_true", help=text)
    add_reading_arguments(parser, "all samples")


def run(args: argparse.Namespace) -> int:
    """Look at the record, print what it holds, write JSON, report and a model file to start from."""
    if args.columns and (preview := _preview_of(args.record.suffix.lower())):
        sys.stdout.write(msgspec.json.encode(preview(args.record)).decode() + "\n")
        return 0
    from orchestrator.records.model_file import read_model

    model = None if args.model is None else read_model(args.model)
    if args.columns:
        header = args.header if args.header is not None or model is None else model.header
        from orchestrator.records.preview import preview_log

        seen = preview_log(args.record, {} if model is None else model.columns, header)
        sys.stdout.write(msgspec.json.encode(seen).decode() + "\n")
        return 0
    from orchestrator.api import inspect as api  # the libraries of the judgement: a second to import

    try:
        with Stages() as stages:
            stages.begin("looking at the record", USUAL)
            found = api.inspect(args.record, model, **reading_of(args))
    except RecordError as error:
        if model is not None and model.stated:
            raise
        text = api.draft_model(args.record, model, header=args.header, problem=str(error))
        with stage_output(args.out, api.ALL_FILES) as folder:
            (folder / api.STARTER).write_text(text, encoding="utf-8")
        raise RecordError(f"{error}; a model file with blanks to fill in is in {args.out / api.STARTER}") from error
    given = {"record": str(args.record), "model": args.model and str(args.model)}
    with stage_output(args.out, found.replaces) as folder:
        found.write(
            folder,
            args.out,
            given | {"part": args.part, "resample": args.resample, "rate": args.rate, "header": args.header},
            args.pictures,
        )
    print_blocks(found.blocks())
    sys.stdout.write(
        f"Model file to start from: {args.out / api.STARTER}\nWritten to {args.out}: report.html, inspect.json\n"
    )
    return 0


def _preview_of(ending: str) -> Callable[[Path], Any] | None:
    """Return what shows the interface of FMUs and SSP files; None: it is a log."""
    if ending == ".fmu":
        from orchestrator.fmi.preview import preview_fmu

        return preview_fmu
    if ending == ".ssp":
        from orchestrator.scenarios.ssp.preview import preview_ssp  # the master: half a second to import

        return preview_ssp
    return None
