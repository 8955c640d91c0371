"""Counts with ``strace`` what hostile FMUs read, change and send outside of their scratch folder.

    python -m benchmarks.traced_fmus
    python -m benchmarks.traced_fmus --commands simulate --only read,write,tcp

Exit code 1 when anything got through.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from tests.support.hostile_fmus import BEHAVIOURS, World, command
from tests.support.tracer import Trace, traced

REACHING = (
    "delete truncate rename chmod write append symlink hard_link read tcp udp unix shell exec fork_bomb kill_parent"
)


def main() -> int:
    """Trace and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--commands", default="check,simulate,sweep")
    parser.add_argument("--only", default=REACHING.replace(" ", ","), help="actions")
    arguments = parser.parse_args()
    bad = 0
    for kind in arguments.commands.split(","):
        total = Trace()
        for action in arguments.only.split(","):
            assert ("step", action) in BEHAVIOURS
            with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
                world = World(Path(folder) / "world")
                try:
                    words = command(world, kind, world.fmu("step", action), 60.0)
                    trace = traced(words, world.folder, world.environment())
                finally:
                    world.close()
            total.children += trace.children
            total.calls += trace.calls
            for name in ("read", "changed", "sent"):
                getattr(total, name).extend(getattr(trace, name))
        for line in (*total.read, *total.changed, *total.sent)[:20]:
            print(f"  {line}")
        count = len(total.read) + len(total.changed) + len(total.sent)
        print(
            f"{kind}: {total.children} children, {total.calls} calls; outside of what is theirs: "
            f"{len(total.read)} files read, {len(total.changed)} changed, {len(total.sent)} messages sent",
            flush=True,
        )
        bad += count or not total.children
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
