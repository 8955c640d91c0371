"""Nuisances of measurement: what a log does to signals. Fitted like effects, reported beside them, part of no FMU."""

from orchestrator.plants.effects import Effect, Scene
from pyfmu_sources.drivetrain_parameters import Parameter

LEAD = Parameter("measurement.lead", "s", 0.0, 0.0, 1.0, "Time by which torques act before their stamp")
SHIFT = Parameter("measurement.shift", "s", 0.0, -1.0, 1.0, "Time by which the load's angle is stamped later")

# Of a shift, that are tried. A load that is late by a hundredth of a sample looks like damping that has gone over from
# the load to the motor, where the shaft is stiff.
SAMPLES = (0.005, 0.012, 0.03, 0.06, 0.12, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)
LIKELY = 3.0  # samples: standard deviation of a shift before a record has been seen
LARGEST = 12.0  # samples


def _leads(scene: Scene) -> dict[str, tuple[float, ...]]:
    return {"lead": tuple(n * scene.h for n in SAMPLES)}


def _shifts(scene: Scene) -> dict[str, tuple[float, ...]]:
    return {"shift": tuple(sign * n * scene.h for n in SAMPLES for sign in (1.0, -1.0))}


EARLY_TORQUE = Effect(
    "early_torque", "log", {"lead": LEAD.name}, "lead", lambda scene: 0.02 * scene.h, _leads,
    bounds=lambda scene: {"lead": (0.0, LARGEST * scene.h)},
    priors=lambda scene: {"lead": (0.0, LIKELY * scene.h)}, measurement=True,
)  # fmt: skip
LATE_LOAD = Effect(
    "late_load", "log", {"shift": SHIFT.name}, "shift", lambda scene: 0.02 * scene.h, _shifts,
    bounds=lambda scene: {"shift": (-LARGEST * scene.h, LARGEST * scene.h)},
    priors=lambda scene: {"shift": (0.0, LIKELY * scene.h)}, both_encoders=True, measurement=True,
    leaves=0.0,  # samples read later are those samples; of requests only the log tells whether they were held
)  # fmt: skip
