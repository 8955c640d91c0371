"""Misfit on held-out data after a friction finding, in units of the noise, on records with LuGre friction.

    PYTHONPATH=. python -m benchmarks.friction_misfit [--records 8] [--seed 7101] [--seconds 20]

One line a record: what was hidden, what was named, misfit over noise of the motor's and the load's encoder with the
friction that the corrected FMU has, and with set-valued friction in its place; the medians at the end.
"""

import argparse
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.proof.misfit import held_out_misfit
from orchestrator.records.model_file import default_model
from tests.support.hidden_effects import single_case

KINDS = ("coulomb_motor", "stribeck_motor", "coulomb_load", "stribeck_load")


def ratios(diagnosis: Diagnosis, set_valued: bool) -> list[float]:
    """Return misfit over noise of each encoder, with the plant's own friction or with the set-valued one."""
    w = diagnosis.workings
    plant = replace(w.plant, realised=None, _index={}) if set_valued else w.plant
    likelihood = w.likelihood
    again = RecordLikelihood(
        plant, likelihood.signals, likelihood.nominal, likelihood.stop, likelihood.settings
    )  # fmt: skip
    found = held_out_misfit(again, w.final.q, [("corrected", w.final.p)], w.parts.held_out, "rad")
    return [misfit.after / misfit.noise for misfit in found]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--records", type=int, default=8)
    parser.add_argument("--seed", type=int, default=7101)
    parser.add_argument("--seconds", type=float, default=20.0)
    arguments = parser.parse_args()
    model = default_model()
    own, plain, right = [], [], 0
    for n in range(arguments.records):
        case = single_case(KINDS[n % len(KINDS)], arguments.seed + n, arguments.seconds)
        diagnosis = diagnose(case.record, model)
        named = [f"{effect.name}@{effect.site}" for effect in diagnosis.effects]
        right += len(named) == 1 and named[0] in case.right[0]
        own.append(ratios(diagnosis, set_valued=False))
        plain.append(ratios(diagnosis, set_valued=True))
        text = [", ".join(f"{value:.2f}" for value in found) for found in (own[-1], plain[-1])]
        hidden = f"{case.kind:15} {case.times_noise:7.1f} x noise"
        print(f"{hidden}  {','.join(named):26} {text[0]:>12}  set-valued {text[1]:>12}", flush=True)
    worst = [np.max(found, axis=1) for found in (own, plain)]
    print(f"{right} of {arguments.records} right; misfit over noise, worse encoder:")
    for law, found in (("as fitted", worst[0]), ("set-valued", worst[1])):
        print(f"  {law:11} median {np.median(found):.2f}, largest {np.max(found):.2f}")


if __name__ == "__main__":
    main()
