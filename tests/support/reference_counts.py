"""Makes and frees instances of an FMU in this process, and says who owns the names of its module after each.

    python -m tests.support.reference_counts FMU START-OF-THE-MODULES-NAME

A line per instance: the number of references, and the types of the containers that hold them.
"""

import gc
import sys
from pathlib import Path

from tests.support.fmu_calls import RawFmu

if __name__ == "__main__":
    raw = RawFmu(Path(sys.argv[1]))
    for _ in range(4):
        raw.library.fmi2FreeInstance(raw.started())
        (names,) = (vars(module) for name, module in sys.modules.items() if name.startswith(sys.argv[2]))
        print(sys.getrefcount(names), sorted(type(owner).__name__ for owner in gc.get_referrers(names)))
