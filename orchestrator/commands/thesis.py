"""``thesis``: every published number beside the recomputed one, errata included."""

import argparse

from orchestrator.api.thesis import thesis
from orchestrator.commands._console import print_blocks
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Nothing to add: the thesis is what it is."""
    del parser


def run(arguments: argparse.Namespace) -> int:
    """Recompute, print and write."""
    with stage_output(arguments.out) as folder:
        result = thesis()
        result.write(folder, arguments.out)
    print_blocks(result.blocks())
    print(f"Written to {arguments.out}: report.html, thesis.json")
    return 0
