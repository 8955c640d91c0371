"""Runs every behaviour of a hostile FMU under every command that runs FMUs, and counts those that were contained.

    python -m benchmarks.hostile_fmus
    python -m benchmarks.hostile_fmus --commands simulate --only fork_bomb

Contained: the right exit code, at most one line of complaint, no file of the user read, changed or deleted, no
connection, no process and no file left, results whole or not at all. Exit code 1 when one is not.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from tests.support.hostile_fmus import BEHAVIOURS, COMMANDS, World, verdict


def main() -> int:
    """Run the matrix."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--only", help="behaviours whose action contains this text")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="every nth behaviour, from the kth on")
    parser.add_argument("--time-limit", type=float, default=4.0)
    parser.add_argument("--at", type=int, default=3, help="which call of fmi2DoStep misbehaves (default: %(default)s)")
    parser.add_argument("--version", choices=("2.0", "3.0"), default="2.0", help="of FMI; 3.0 with --commands check")
    arguments = parser.parse_args()
    first, _, every = arguments.part.partition("/")
    # FMI 3.0 has no call that sets an experiment up.
    places = [b for b in BEHAVIOURS if arguments.version == "2.0" or b[0] != "setup"]
    chosen = [b for b in places if not arguments.only or arguments.only in b[1]][int(first) - 1 :: int(every)]
    bad = 0
    for kind in arguments.commands.split(","):
        contained = 0
        for place, action in chosen:
            with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
                world = World(Path(folder) / "world", arguments.version)
                try:
                    wrong = verdict(world, kind, place, action, arguments.time_limit, arguments.at)
                finally:
                    world.close()
            contained += not wrong
            if wrong:
                print(f"{kind}: {action} in {place}: {'; '.join(wrong)}", flush=True)
        print(f"{kind}: {contained} of {len(chosen)} contained", flush=True)
        bad += len(chosen) - contained
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
