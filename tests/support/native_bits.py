"""A native plant beside the Python slave, step by step in the same calls; used by tests and benchmarks."""

import ctypes
import random
from pathlib import Path
from typing import Any

from pyfmu_sources.drivetrain.drivetrain_slave import Drivetrain
from tests.support.native_pair import Driver

MODELS = ("none", "dead_zone", "nordin", "hysteresis", "rigid_impact", "elastic_impact")
EFFECTS: dict[str, dict[str, float]] = {
    "input_delay": {"effects.input_delay.delay": 0.0123},
    "torque_saturation": {"effects.torque_saturation.limit": 12.0},
    "torque_ripple": {"effects.torque_ripple.amplitude": 1.5},
    "coulomb_friction": {"effects.coulomb_friction.motor.torque": 1.0, "effects.coulomb_friction.load.torque": 2.0},
    "stribeck_friction": {
        "effects.stribeck_friction.motor.coulomb": 0.8,
        "effects.stribeck_friction.motor.breakaway": 1.4,
        "effects.stribeck_friction.load.breakaway": 2.0,
    },
    "hardening_stiffness": {"effects.hardening_stiffness.cubic": 1e6, "effects.hardening_stiffness.sharpness": 0.7},
    "gear_eccentricity": {"effects.gear_eccentricity.amplitude": 1e-3, "effects.gear_eccentricity.lever_arm": 0.3},
    "load_torque": {"effects.load_torque.torque": 3.0},
    "gravity_load": {"effects.gravity_load.amplitude": 8.0},
    "extra_resonance": {"effects.extra_resonance.inertia": 0.4},
    "quadratic_drag": {"effects.quadratic_drag.coefficient": 0.5},
    "sensor_offset": {"effects.sensor_offset.load.offset": 0.01},
    "presliding": {
        "effects.coulomb_friction.load.torque": 2.0,
        "effects.presliding.load.distance": 1e-3,
        "effects.presliding.load.damping": 1.0,
    },
    "directional_friction": {"effects.directional_friction.motor.difference": 0.05},
    "load_dependent_friction": {"effects.load_dependent_friction.load.coefficient": 0.05},
    "periodic_friction": {
        "effects.coulomb_friction.motor.torque": 1.0,
        "effects.periodic_friction.motor.amplitude": 0.3,
    },
    "drive_filter": {"effects.drive_filter.time_constant": 0.01},
    "rate_limit": {"effects.rate_limit.rate": 500.0},
    "torque_ripple_second": {"effects.torque_ripple.second.amplitude": 0.4},
    "spring_load": {"effects.spring_load.stiffness": 20.0, "effects.spring_load.cubic": 5.0},
    "end_stop": {"effects.end_stop.lower": -0.2, "effects.end_stop.upper": 0.2},
    "varying_inertia": {"effects.varying_inertia.amplitude": 0.3},
    "varying_stiffness": {"effects.varying_stiffness.amplitude": 300.0},
    "shaft_hysteresis": {"effects.shaft_hysteresis.torque": 2.0},
    "impact_damping": {"effects.impact_damping.depth": 1e-3},
}


TRAIN: dict[str, dict[str, float]] = {
    "both gaps": {},
    "light shaft": {"J_s": 0.004},
    "friction": {f"effects.coulomb_friction.{site}.torque": 1.0 for site in ("motor", "shaft", "load")},
    "dead time": {"effects.input_delay.delay": 0.0123, "effects.torque_saturation.limit": 12.0},
}
"""Values of ``TwoStageTrain`` at which it is compared."""


def drivetrain_values(model: int, effect: dict[str, float]) -> dict[str, float]:
    """Return what a drivetrain is compared at: a backlash model, from 1, and an effect."""
    return {"alpha": 0.01, "theta_m_start": 0.05, "omega_l_start": 0.3, **effect, "backlash_model": model}


class Comparison:
    """One Python slave and one native instance of a plant in step, with ``values`` of its parameters.

    ``refused``: these values were refused, by both with the same message.
    """

    def __init__(self, library: Path, values: dict[str, float], seed: int, plant: Any = Drivetrain) -> None:
        self.rng = random.Random(seed)
        self.python = plant()
        self.native = Driver(library)
        table = {variable.name: (n, variable.type == "Real") for n, variable in enumerate(plant.table)}
        for name, value in values.items():
            number, real = table[name]
            (self.python.set_real if real else self.python.set_integer)([number], [value])
            assert self.native.set("Real" if real else "Integer", [number], [value])[0] == 0
        self.python.setup_experiment(0.0)
        self.python.enter_initialization_mode()
        self.python.exit_initialization_mode()
        self.native.setup(0.0, None)
        self.native.call("fmi2EnterInitializationMode")
        self.refused = bool(self.python.log_queue)
        status, _, messages = self.native.call("fmi2ExitInitializationMode")
        assert (status != 0) == self.refused
        assert [message[-1] for message in messages] == [said.msg for said in self.python.log_queue]
        outputs = {n for n, variable in enumerate(plant.table) if variable.causality == "output"}
        reals = sorted(n for n, real in table.values() if real and n in outputs)
        wholes = sorted(outputs - set(reals))
        self.references = (ctypes.c_uint * len(reals))(*reals)
        self.values = (ctypes.c_double * len(reals))()
        self.whole = (ctypes.c_uint * len(wholes))(*wholes)
        self.contact = (ctypes.c_int * len(wholes))()
        self.time = 0.0
        self.taken = 0
        self.kept: list[tuple[Any, float]] = []

    def agree(self) -> bool:
        """Tell whether all outputs have the same bits."""
        library, component = self.native.fmu.library, self.native.component
        library.fmi2GetReal(component, self.references, ctypes.c_size_t(len(self.references)), self.values)
        library.fmi2GetInteger(component, self.whole, ctypes.c_size_t(len(self.whole)), self.contact)
        mine = self.python.get_real(list(self.references))
        same = bytes(type(self.values)(*mine)) == bytes(self.values)
        return same and self.python.get_integer(list(self.whole)) == list(self.contact)

    def step(self) -> bool:
        """Take one random step with both; tell whether they agree."""
        rng = self.rng
        if rng.random() < 0.05:
            inputs = [rng.uniform(-30.0, 30.0), rng.choice([0.0, rng.uniform(-5.0, 5.0)])]
            self.python.set_real([0, 1], inputs)
            self.native.set("Real", [0, 1], inputs)
        size = rng.choice((1e-3, 1e-3, 5e-4, 2e-3))
        taken = self.python.do_step(self.time, size)
        status = self.native.fmu.step(self.native.component, self.time, size)
        self.native.fmu.messages.clear()
        if taken:
            self.time += size
            self.taken += 1
        if rng.random() < 0.002:
            self.native.save()
            self.kept.append((self.python._get_fmu_state(), self.time))
        elif self.kept and rng.random() < 0.002:
            number = rng.randrange(len(self.kept))
            self.native.restore(number, serialised=rng.random() < 0.5)
            self.python._set_fmu_state(self.kept[number][0])
            self.time = self.kept[number][1]
        return taken == (status == 0) and self.agree()
