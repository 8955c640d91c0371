"""Bits of the native plant against CPython's, step by step: every backlash model, and every effect with every model.

Run as ``python -m benchmarks.native_bits [STEPS_PER_MODEL [STEPS_PER_EFFECT [EFFECT or MODEL ...]]]`` (defaults 20000
and 300; all effects and models).
Inputs and step sizes are random; nine of ten steps must be taken; on the way states are saved and restored in both. It
prints how many steps agreed in all outputs, to the last bit, and stops with exit code 1 at the first that do not.
"""

import sys
import tempfile
import time
from pathlib import Path

from orchestrator.building.native_build import ensure_native
from tests.support.native_bits import EFFECTS, MODELS, Comparison


def main() -> int:
    """Compare and print."""
    counts = [int(word) for word in sys.argv[1:] if word.isdigit()]
    chosen = [word for word in sys.argv[1:] if word in EFFECTS] or list(EFFECTS)
    models = [word for word in sys.argv[1:] if word in MODELS] or list(MODELS)
    of_model, of_effect = (counts + [20000, 300][len(counts) :])[:2]
    with tempfile.TemporaryDirectory() as folder:
        library = ensure_native(["Drivetrain"], Path(folder), here=True)["Drivetrain"]
        total = 0
        for name, effect, count in (("no effect", {}, of_model), *((n, EFFECTS[n], of_effect) for n in chosen)):
            begin = time.process_time()
            for model in (MODELS.index(word) + 1 for word in models):
                comparison = Comparison(library, model, effect, seed=model)
                for n in range(count):
                    if not comparison.step() or comparison.taken * 10 < n * 9:
                        print(f"{name}, {MODELS[model - 1]}: step {n} differs: {list(comparison.values)}")
                        return 1
                total += count
            seconds = time.process_time() - begin
            print(f"{name:<20} {count:>9,} steps of each of {len(models)} models alike  ({seconds:.1f} s)", flush=True)
        print(f"{total:,} steps, every bit alike")
    return 0


if __name__ == "__main__":
    sys.exit(main())
