"""Bits of native plants against CPython's, step by step: backlash models, effects with every model, two stages.

Run as ``python -m benchmarks.native_bits [STEPS_PER_MODEL [STEPS_PER_EFFECT [EFFECT, MODEL or CASE ...]]]`` (defaults
20000 and 300; all effects, models and cases of two stages).
Inputs and step sizes are random; nine of ten steps must be taken, unless the values were refused; on the way states
are saved and restored in both. It prints how many steps agreed in all outputs, to the last bit, and stops with exit
code 1 at the first that do not.
"""

import sys
import tempfile
import time
from pathlib import Path

from orchestrator.building.native_build import ensure_native
from pyfmu_sources.train.two_stage_train_slave import TwoStageTrain
from tests.support.native_bits import EFFECTS, MODELS, TRAIN, Comparison, drivetrain_values


def main() -> int:
    """Compare and print."""
    counts = [int(word) for word in sys.argv[1:] if word.isdigit()]
    chosen = [word for word in sys.argv[1:] if word in EFFECTS] or list(EFFECTS)
    models = [word for word in sys.argv[1:] if word in MODELS] or list(MODELS)
    of_model, of_effect = (counts + [20000, 300][len(counts) :])[:2]
    trains = [word for word in sys.argv[1:] if word in TRAIN] or list(TRAIN)
    with tempfile.TemporaryDirectory() as folder:
        libraries = ensure_native(["Drivetrain", "TwoStageTrain"], Path(folder), here=True)
        total = 0
        for name, effect, count in (("no effect", {}, of_model), *((n, EFFECTS[n], of_effect) for n in chosen)):
            begin = time.process_time()
            for word in models:
                model = MODELS.index(word) + 1
                comparison = Comparison(libraries["Drivetrain"], drivetrain_values(model, effect), model)
                if not alike(comparison, count, f"{name}, {word}"):
                    return 1
                total += count
            seconds = time.process_time() - begin
            print(f"{name:<20} {count:>9,} steps of each of {len(models)} models alike  ({seconds:.1f} s)", flush=True)
        for name in trains:
            if not alike(Comparison(libraries["TwoStageTrain"], TRAIN[name], 1, TwoStageTrain), of_model, name):
                return 1
            total += of_model
            print(f"{name:<20} {of_model:>9,} steps of two stages alike", flush=True)
        print(f"{total:,} steps, every bit alike")
    return 0


def alike(comparison: Comparison, count: int, name: str) -> bool:
    """Tell whether all steps have the same bits, and most are taken; say where not."""
    for n in range(count):
        if not comparison.step() or (comparison.taken * 10 < n * 9 and not comparison.refused):
            print(f"{name}: step {n} differs: {list(comparison.values)}")
            return False
    return True


if __name__ == "__main__":
    sys.exit(main())
