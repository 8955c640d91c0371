"""How many of the faults of tests/support/broken_plants.py `check` names by the rule that is meant, by cause.

Run as ``python -m benchmarks.plant_faults [--every N]`` (a C compiler; some 3 s a fault).
"""

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.broken_plants import broken_plants

OPTIONS = CheckOptions(limits=Limits(time=10.0))


def main() -> None:
    """Check, and print the counts and what was missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--every", type=int, default=1, help="take each N-th fault alone")
    arguments = parser.parse_args()
    named: dict[tuple[str, str], list[bool]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for plant in broken_plants()[:: arguments.every]:
            path = plant.build(Path(folder) / f"{plant.name}.fmu")
            rules = {finding.rule for finding in check_fmu(path, OPTIONS).findings}
            named[plant.cause, plant.version].append(plant.rule in rules)
            path.unlink()
            if plant.rule not in rules:
                found = ", ".join(sorted(rules)) or "nothing"
                print(f"{plant.name}: {plant.rule} was meant, found {found}", flush=True)
    for (cause, version), outcomes in sorted(named.items()):
        print(f"{cause}, FMI {version}: {sum(outcomes)} of {len(outcomes)}")
    print(f"all: {sum(map(sum, named.values()))} of {sum(map(len, named.values()))}")


if __name__ == "__main__":
    main()
