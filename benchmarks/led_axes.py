"""Benchmark of the diagnosis on single axes that a controller leads: right, missed and wrong names by what is hidden.

    python -m benchmarks.led_axes --records 80 --seed 0

A controller hides from predictions what acts on an axis, and its torque is measured with noise. Records are of the
independent simulation in ``tests/support/led_axis.py``. One line a record as it goes, the count at the end.
"""

import argparse
import tempfile
import time
from collections import Counter
from pathlib import Path

import orchestrator as oc
from tests.support.led_axis import LedAxis, led_axis

MODEL = """fmu = "ServoAxis"
[parameters.J]
value = {0!r}
relative_uncertainty = 0.6
[parameters.b]
value = {1!r}
relative_uncertainty = 0.9
"""


def judged(case: LedAxis, found: "oc.DiagnosisResult") -> str:
    """Return "right", "missed" or "wrong"; an effect that the record cannot tell from a right one is right."""
    families = [{effect.name, *(label.partition("@")[0] for label in effect.family)} for effect in found.effects]
    families = [one | {"coulomb_friction"} if "stribeck_friction" in one else one for one in families]  # it contains it
    if any(not family & case.right for family in families):
        return "wrong"
    if case.hidden == "none":
        return "right" if found.verdict in ("none", "parameters") else "missed"
    return "right" if all(any(name in family for family in families) for name in case.right) else "missed"


def sizes(case: LedAxis, found: "oc.DiagnosisResult") -> dict[str, float]:
    """Return the relative error of each right effect's size."""
    errors = {}
    for effect in found.effects:
        true = case.truth.get(effect.name, 0.0)
        if true:
            errors[effect.name] = abs(next(iter(effect.parameters.values())).value) / true - 1.0
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    count: Counter[tuple[str, str]] = Counter()
    for seed in range(args.seed, args.seed + args.records):
        case, begun = led_axis(seed), time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder) / "axis.toml"
            model.write_text(MODEL.format(*case.stated), encoding="utf-8")
            found = oc.diagnose(case.record, model=model)
        said = judged(case, found)
        count[case.hidden, said] += 1
        errors = {name: f"{100.0 * error:.1f} %" for name, error in sizes(case, found).items()}
        names = [effect.name for effect in found.effects]
        print(
            f"{said:>6} {seed} {case.hidden}: {found.verdict}, {found.trust.level.word}, {names} {errors}, noise "
            f"{case.truth['noise']}, size {case.truth['size']:.2f}, {time.process_time() - begun:.0f} s",
            flush=True,
        )
    for hidden in dict.fromkeys(kind for kind, _ in count):
        print(f"{hidden:>22}", {said: count[hidden, said] for said in ("right", "missed", "wrong")})


if __name__ == "__main__":
    main()
