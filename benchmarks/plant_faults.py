"""How many of the faults of tests/support/broken_plants.py `check` names by the rule that is meant, by cause.

    python -m benchmarks.plant_faults [--every N]
    python -m benchmarks.plant_faults --checker FMPy
    python -m benchmarks.plant_faults --checker fmutool --program PROGRAM

A C compiler is needed; `check` takes some 2 s a fault. Another checker has seen a fault when it says anything that it
does not say of the sound plant with the same clocks and interfaces, whatever the words.
"""

import argparse
import tempfile
from collections import defaultdict
from functools import cache
from pathlib import Path

from benchmarks.other_checkers import OTHERS, complaints
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.broken_plants import BrokenPlant, broken_plants
from tests.support.plant import build_plant

OPTIONS = CheckOptions(limits=Limits(time=10.0))


def main() -> None:
    """Check, and print the counts and what was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=1, help="take each N-th fault alone")
    parser.add_argument("--checker", choices=("check", *OTHERS), default="check")
    parser.add_argument("--program", default="", help="the program of another checker, where it is one")
    arguments = parser.parse_args()
    named: dict[tuple[str, str], list[bool]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for plant in broken_plants()[:: arguments.every]:
            path = plant.build(Path(folder) / "plant.fmu")
            if arguments.checker == "check":
                seen = names_fault(plant, path)
            else:
                sound = sound_complaints(
                    arguments.checker, arguments.program, plant.version, plant.interfaces, plant.clock
                )
                seen = bool(complaints(arguments.checker, arguments.program, path) - sound)
            named[plant.cause, plant.version].append(seen)
            path.unlink()
    for (cause, version), outcomes in sorted(named.items()):
        print(f"{cause}, FMI {version}: {sum(outcomes)} of {len(outcomes)}")
    print(f"all: {sum(map(sum, named.values()))} of {sum(map(len, named.values()))}")


def names_fault(plant: BrokenPlant, path: Path) -> bool:
    """Whether `check` names the rule that is meant; a fault that it does not name is printed."""
    rules = {finding.rule for finding in check_fmu(path, OPTIONS).findings}
    if plant.rule not in rules:
        found = ", ".join(sorted(rules)) or "nothing"
        print(f"{plant.name}: {plant.rule} was meant, found {found}", flush=True)
    return plant.rule in rules


@cache
def sound_complaints(checker: str, program: str, version: str, interfaces: str, clock: str) -> frozenset[str]:
    """What another checker says of a plant without a fault."""
    with tempfile.TemporaryDirectory() as folder:
        changes = {"clock": clock} if clock else {}
        return complaints(checker, program, build_plant(Path(folder) / "plant.fmu", version, interfaces, "", changes))


if __name__ == "__main__":
    main()
