"""``build``: the FMUs, into ``fmus/``, native ones into ``fmus/native/``."""

import argparse
from pathlib import Path

from orchestrator.api.build import PLATFORMS, VERSIONS, build, short_path
from orchestrator.building.build import default_directory
from orchestrator.building.native_build import native_directory
from orchestrator.commands._console import print_blocks
from orchestrator.commands._parser import options_for
from orchestrator.commands._stages import Stages
from orchestrator.shared.output import stage_output

RESULTS = Path("results") / "build"
FLAGS = {"directory": "--out"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("names", nargs="*", metavar="FMU", help="which FMUs (default: all)")
    usual = f"{short_path(default_directory())}, --native: {short_path(native_directory())}, report: {RESULTS}"
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"where FMUs and the report go (default: {usual})")
    text = "platforms of native FMUs: this machine (default), or all (takes minutes)"
    parser.add_argument("--platforms", choices=PLATFORMS, default=PLATFORMS[0], help=text)
    text = "version of FMI (default: 2); FMUs of 3 are native, into fmi3/"
    parser.add_argument("--fmi", type=int, choices=VERSIONS, default=2, help=text)
    for flag, text in (
        ("--native", "translate to C and compile: FMUs that need no Python at run time"),
        ("--real-outputs", "native FMUs with real outputs only, for hosts that read every output as Real; into real/"),
        ("--force", "build FMUs that are up to date too"),
    ):
        parser.add_argument(flag, action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Build what is missing or stale and say what this machine cannot give."""
    with Stages() as stages:
        stages.begin("building", 0.0)
        result = build(**options_for(build, args), directory=args.out, progress=stages.at)
    place = args.out or RESULTS
    with stage_output(place) as folder:
        result.write(folder, place)
    print_blocks(result.blocks())
    return 0
