"""Plants of five domains as equations of their own, and the effects that may be hidden around each.

Nothing is shared with the library. FMUs of others are read from a folder by file name; those in C come from
:mod:`tests.support.box_fmu`.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numba
import numpy as np

from tests.support.box_fmu import DOMAINS, write_fmu

INPUTS = ("input_gain", "input_offset", "input_delay", "input_lag", "input_saturation", "input_dead_zone",
          "input_rate_limit", "input_quantisation", "unknown_dropouts")  # fmt: skip
OUTPUTS = ("output_gain", "output_offset", "output_delay", "output_lag", "output_quantisation")
PORTS = ("coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_drag", "spring", "hardening_spring",
         "gravity", "ripple", "load", "directional_friction", "unknown_coming_load", "unknown_growing_drag",
         "unknown_patchy_drag", "unknown_sticking_spot")  # fmt: skip
INSIDE = "unknown_inside"
SERIES = ("input_delay", "input_saturation", "input_dead_zone", "input_lag", "input_rate_limit", "input_quantisation")
MOTION = ("coulomb_friction", "stribeck_friction", "quadratic_drag", "hardening_spring", "ripple", "output_delay")


@dataclass(frozen=True)
class Plant:
    """One plant: number of its equations, FMU, and what is needed to drive and map it.

    Attributes:
        parameters: FMU's name -> nominal value, 5 % uncertain.
        inputs: name, drive and offset of each recorded input; effects act on the first.
        outputs: name, place of the state, noise.
        port: input, position, velocity; and the place of the position's state.
        loop: gains of a position controller; () where there is none.
        inside: something within it can be changed that no port reaches.
    """

    number: int
    name: str
    exporter: str
    domain: str
    parameters: dict[str, float]
    inputs: tuple[tuple[str, float, float], ...]
    outputs: tuple[tuple[str, int, float], ...]
    port: tuple[str, str, str, int]
    h: float
    effects: tuple[str, ...]
    loop: tuple[float, ...] = ()
    inside: bool = False
    fixed: dict[str, float] = field(default_factory=dict)
    start: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    unknown: tuple[str, ...] = ()
    options: str = ""
    quiet: float = 1.0

    def fmu(self, folder: Path, foreign: Path | None) -> Path | None:
        """Return its FMU, made or found; None where it is not at hand."""
        if self.exporter == "own C":
            return write_fmu(folder / self.name, next(d for d in DOMAINS if f"{d.name}.fmu" == self.name))
        path = None if foreign is None else foreign / self.name
        return path if path is not None and path.exists() else None

    def map(self, path: Path) -> Path:
        """Write the map that a user would."""
        lines = ["[inputs]", *(f'"{name}" = {{ hold = "zero" }}' for name, _, _ in self.inputs), "[outputs]"]
        lines += [f'"{name}" = {{ noise = {noise} }}' for name, _, noise in self.outputs]
        lines += ["[parameters]", *(f'"{name}" = {{ uncertainty = "5 %" }}' for name in self.parameters)]
        lines += [f'"{name}" = {{ value = {value} }}' for name, value in self.fixed.items()]
        effort, position, velocity, _ = self.port
        lines += ["[ports.port]", f'input = "{effort}"', f'position = "{position}"']
        lines += [f'velocity = "{velocity}"'] if velocity else []
        path.write_text("\n".join([*lines, "[options]", self.options]) + "\n", encoding="utf-8")
        return path


MECHANICAL = ("unknown_coming_load", "unknown_growing_drag", "unknown_patchy_drag", "unknown_sticking_spot",
              "unknown_dropouts")  # fmt: skip
FLOWS = ("unknown_coming_load", "unknown_dropouts")
PLANTS = (
    Plant(0, "Spring.fmu", "own C", "translation", {"m": 1.0, "k": 20.0, "c": 0.8}, (("F", 6.0, 0.0),),
          (("x", 0, 2e-4),), ("F", "x", "", 0), 0.01, (*SERIES, *MOTION, "load"), (60.0, 6.0), unknown=MECHANICAL),
    Plant(1, "TwoMass.fmu", "own C", "rotation", {"J1": 0.02, "J2": 0.05, "k": 60.0, "c": 0.05, "b": 0.04},
          (("M", 0.7, 0.0),), (("phi1", 0, 3e-4), ("phi2", 2, 3e-4)), ("M", "phi1", "", 0), 0.005,
          (*SERIES, *MOTION, "gravity", "load", "spring"), (3.0, 0.25), True, unknown=MECHANICAL),
    Plant(2, "Circuit.fmu", "own C", "electricity", {"L": 0.5, "R": 2.0, "C": 0.02}, (("U", 10.0, 0.0),),
          (("q", 0, 3e-4),), ("U", "q", "", 0), 0.02, (*SERIES, "quadratic_drag", "output_delay"),
          unknown=MECHANICAL),
    Plant(3, "Tanks.fmu", "own C", "hydraulics", {"A1": 1.5, "A2": 1.0, "k1": 0.02, "k2": 0.03},
          (("qin", 0.02, 1.0),), (("h1", 0, 1e-3), ("h2", 1, 1e-3)), ("qin", "h1", "", 0), 2.0,
          ("input_delay", "input_saturation", "input_lag", "input_rate_limit", "output_delay"), (), True,
          unknown=FLOWS),
    Plant(4, "edrive_mass_dymola.fmu", "Dymola", "rotation", {"inertia.J": 0.002, "damper.d": 0.001},
          (("M_A", 0.1, 0.0),), (("phiA", 0, 2e-4),), ("M_B", "phiA", "wA", 0), 0.005,
          (*SERIES, *MOTION, "gravity", "load"), (0.5, 0.03), unknown=MECHANICAL, options="tolerance = 1e-8"),
    Plant(5, "Pendulum_pythonfmu.fmu", "PythonFMU", "rotation", {"J": 0.05, "d": 0.04, "mgl": 0.9},
          (("tau", 0.45, 0.0),), (("phi", 0, 1e-3),), ("tau", "phi", "", 0), 0.01,
          (*SERIES, "coulomb_friction", "stribeck_friction", "quadratic_drag", "load", "output_delay"), (3.0, 0.4),
          unknown=MECHANICAL),
    Plant(6, "QuarterCar_ownc.fmu", "other C", "translation",
          {"ms": 300.0, "mu": 40.0, "ks": 16000.0, "cs": 1200.0, "kt": 150000.0},
          (("f", 300.0, 0.0), ("road", 0.01, 0.0)), (("zs", 0, 1e-4), ("zu", 1, 1e-4)), ("f", "zs", "", 0), 0.01,
          (*SERIES, "coulomb_friction", "quadratic_drag", "spring", "load", "output_delay"), (), True,
          unknown=MECHANICAL),
    Plant(7, "TwoRooms_ownc.fmu", "other C", "heat",
          {"Ca": 6e4, "Cw": 6e5, "Gaw": 120.0, "Gwo": 40.0, "Ga": 15.0}, (("heater", 1500.0, 1.0), ("Tout", 3.0, 1.5)),
          (("Tair", 0, 0.05),), ("heater", "Tair", "", 0), 300.0,
          ("input_delay", "input_saturation", "input_lag", "input_rate_limit", "output_lag"), (), True,
          start=(18.0, 16.0, 0.0, 0.0), unknown=FLOWS),
    Plant(9, "tank3_20sim.fmu", "20-sim", "hydraulics",
          {"WaterTank3.Tank3.area": 1.0, "WaterTank3.Valve.resistance": 7.0},
          (("inFlow", 1.0, 1.2), ("valveControl", 0.0, 1.0)), (("level", 0, 2e-3),), ("inFlow", "level", "", 0), 0.1,
          ("input_delay", "input_saturation", "input_lag", "input_rate_limit"), unknown=FLOWS),
    Plant(10, "emachine.fmu", "Dymola", "electricity", {"resistor.R": 1.0, "inductor.L": 0.001},
          (("U", 10.0, 0.0), ("w", 100.0, 0.0)), (("I", 0, 5e-3),), ("U", "I", "", 0), 1e-4,
          (*SERIES, "output_delay", "output_lag"), unknown=FLOWS, options="tolerance = 1e-8"),
    Plant(11, "cosim_chassis.fmu", "C++ framework", "translation", {"mass": 400.0},
          (("force", 600.0, 0.0),), (("position", 0, 2e-4),), ("force", "position", "velocity", 0), 0.01,
          (*SERIES, "coulomb_friction", "quadratic_drag", "spring", "load", "output_delay"), (40000.0, 5000.0),
          unknown=MECHANICAL, fixed={"gravity": 0.0}),
)  # fmt: skip


@numba.njit(cache=True)
def rates(number, x, u, f, p, inside):
    """Return the rates of the state under inputs ``u`` and effort ``f`` at the port."""
    d = np.zeros(4)
    if number == 0:
        d[0], d[1] = x[1], (u[0] + f - p[1] * x[0] - p[2] * x[1]) / p[0]
    elif number == 1:
        twist = x[0] - x[2]
        if inside > 0.0:
            twist = np.sign(twist) * max(abs(twist) - inside, 0.0)
        t = p[2] * twist + p[3] * (x[1] - x[3])
        d[0], d[2] = x[1], x[3]
        d[1] = (u[0] + f - t - p[4] * x[1]) / p[0]
        d[3] = t / p[1]
    elif number == 2:
        d[0], d[1] = x[1], (u[0] + f - p[1] * x[1] - x[0] / p[2]) / p[0]
    elif number == 3:
        gap = x[0] - x[1]
        a = p[2] * np.sign(gap) * (np.sqrt(abs(gap)) if abs(gap) > 0.01 else abs(gap) * 10.0)
        b = p[3] * (np.sqrt(x[1]) if x[1] > 0.01 else x[1] * 10.0)
        b *= 1.0 + inside * x[1]
        d[0], d[1] = (u[0] + f - a) / p[0], (a - b) / p[1]
    elif number == 4:
        d[0], d[1] = x[1], (u[0] + f - p[1] * x[1]) / p[0]
    elif number == 5:
        d[0], d[1] = x[1], (u[0] + f - p[1] * x[1] - p[2] * np.sin(x[0])) / p[0]
    elif number == 6:
        y, v = x[0] - x[1], x[2] - x[3]
        s = -p[2] * y - p[3] * v - inside * 1e8 * y * y * y
        d[0], d[1] = x[2], x[3]
        d[2], d[3] = (s + u[0] + f) / p[0], (-s - p[4] * (x[1] - u[1])) / p[1]
    elif number == 7:
        g = p[3] * (1.0 + inside * (x[1] - 16.0))
        d[0] = (u[0] + f - p[2] * (x[0] - x[1]) - p[4] * (x[0] - u[1])) / p[0]
        d[1] = (p[2] * (x[0] - x[1]) - g * (x[1] - u[1])) / p[1]
    elif number == 9:
        d[0] = (u[0] + f) / p[0] - 9.81 * x[0] / p[1]  # the valve feels the volume
    elif number == 10:
        d[0] = (u[0] + f - p[0] * x[0] - 0.01 * u[1]) / p[1]
    else:
        d[0], d[1] = x[1], (f - u[0]) / p[0]
    return d


SPEEDS = {0: 1, 1: 1, 2: 1, 4: 1, 5: 1, 6: 2, 11: 1}  # place of the velocity at the port by number of the plant
