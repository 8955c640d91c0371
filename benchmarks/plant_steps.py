"""How long single steps of the plant take, over random legal parameters, inputs and steps of every model and effect.

    python -m benchmarks.plant_steps [--runs 60] [--steps 60] [--seed 1] [--extreme]

Prints, per backlash model, how many steps were made, how many of them were refused (NaN), the median and the longest
time of a compiled step [ms], and which effect had the longest. ``--extreme`` draws parameters over their whole range.
"""

import argparse
import time
from types import ModuleType

import numpy as np

from pyfmu_sources.drivetrain.equations import DEFAULTS, NAMES, PARAMETERS, DrivetrainParameters
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS
from pyfmu_sources.laws.parameter_rows import with_values
from tests.support.compiled_plants import compiled_plant

STEPS = (1e-5, 2e-4, 1e-3, 5e-3, 1e-2, 2e-2)


def effects() -> dict[str, list[str]]:
    """Return the parameters of each effect, "none" and "all" included."""
    groups: dict[str, list[str]] = {"none": []}
    for name in NAMES:
        if name.startswith("effects."):
            groups.setdefault(name.split(".")[1], []).append(name)
    groups["all"] = [name for names in groups.values() for name in names]
    return groups


def draw_machine(rng: np.random.Generator, model: int, names: list[str]) -> DrivetrainParameters:
    """Return parameters of a machine of ordinary size with an effect on, its size spread over two decades."""

    def spread(value: float, decades: float = 0.5) -> float:
        return float(value * 10.0 ** rng.uniform(-decades, decades))

    ordinary = {"J_m": 0.4, "J_l": 5.6, "k": 3300.0, "c": 1.0, "b_m": 0.1, "b_l": 1.0, "i": 4.0, "tau": 0.3}
    ordinary |= {"contact_stiffness": 33000.0, "contact_damping": 10.0}
    plain = {name: spread(value) for name, value in ordinary.items()}
    plain |= {"alpha": spread(3e-3, 1.0), "backlash_model": float(model)}
    plain["restitution"] = float(rng.choice([0.0, rng.uniform(), 0.5]))
    sizes = {"amplitude": 3.0, "torque": 3.0, "coulomb": 2.0, "breakaway": 4.0, "stribeck_speed": 0.4, "cubic": 3e6,
             "inertia": 0.5, "coefficient": 0.5, "limit": 100.0, "cycles_per_rev": 5.0, "phase": 0.4,
             "distance": 1e-4, "damping": 0.2, "difference": 0.05, "time_constant": 0.01, "rate": 300.0,
             "stiffness": 30.0, "upper": 0.1, "depth": 1e-3, "twist": 1e-3}  # fmt: skip
    for name in names:
        size = sizes.get(name.rpartition(".")[2])
        if name == "effects.gear_eccentricity.amplitude":
            size = 1e-3
        if name == "effects.varying_stiffness.amplitude":
            size = 0.1
        if name == "effects.end_stop.stiffness":
            size = 1e4
        if name.startswith("effects.presliding"):
            site = name.split(".")[2]
            plain[f"effects.coulomb_friction.{site}.torque"] = spread(2.0)
        if size is not None:
            plain[name] = spread(size)
    drawn: DrivetrainParameters = with_values(DEFAULTS, plain)
    return drawn


def draw_extreme(rng: np.random.Generator, model: int, names: list[str]) -> DrivetrainParameters:
    """Return a machine of which a few parameters are drawn from their whole legal range."""
    p = list(draw_machine(rng, model, names))
    for place in rng.choice(len(PARAMETERS), 3, replace=False):
        entry = PARAMETERS[place]
        if entry.name == "backlash_model":
            continue
        ends = [entry.minimum, entry.maximum, 10.0 ** rng.uniform(-9, 12)]
        p[place] = float(min(max(rng.choice(ends), entry.minimum), entry.maximum))
    return DrivetrainParameters._make(p)


def warm_up(plant: ModuleType) -> None:
    """Compile all that the steps need."""
    p = with_values(DEFAULTS, {"alpha": 0.01})
    table = plant.prepare(p, 1e-3)
    x = plant.consistent_start((0.0,) * 8, p)
    plant.advance(x, plant.initial_mode(x, p), p, 1.0, 0.0, 1e-3, table)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--extreme", action="store_true")
    arguments = parser.parse_args()
    plant = compiled_plant("drivetrain")
    warm_up(plant)
    rng = np.random.default_rng(arguments.seed)
    draw = draw_extreme if arguments.extreme else draw_machine
    inputs = (1.0, 1.0, 1.0, 1e3, 1e300) if arguments.extreme else (1.0,)
    print(f"{'model':16}{'steps':>9}{'refused':>9}{'median ms':>11}{'longest ms':>12}{'prepare ms':>12}  longest with")
    for model, title in enumerate(BACKLASH_MODELS):
        times, refused, prepared, worst = [], 0, 0.0, (0.0, "")
        for effect, names in effects().items():
            for _ in range(arguments.runs):
                p, h = draw(rng, model, names), float(rng.choice(STEPS))
                begin = time.perf_counter()
                table = plant.prepare(p, h)
                prepared = max(prepared, 1e3 * (time.perf_counter() - begin))
                x = plant.consistent_start((0.0, float(rng.normal()), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p)
                mode = plant.initial_mode(x, p)
                u, T_l = 0.0, 0.0
                for n in range(arguments.steps):
                    if n % 5 == 0:
                        u = float(rng.normal() * 60.0 * rng.choice(inputs))
                        T_l = float(rng.choice([0.0, 10.0 * rng.normal()]))
                    begin = time.perf_counter()
                    x, mode = plant.advance(x, mode, p, u, T_l, h, table)
                    spent = 1e3 * (time.perf_counter() - begin)
                    times.append(spent)
                    worst = max(worst, (spent, f"{effect}, h {h:g} s"))
                    if not np.isfinite(x).all():
                        refused += 1
                        break
        print(f"{title:16}{len(times):9d}{refused:9d}{np.median(times):11.4f}{max(times):12.2f}{prepared:12.2f}"
              f"  {worst[1]}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
