"""What a user takes away: the loop as FMUs, as a scenario, as SSP, and as plain C for a drive."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestrator.building.build import build_variant
from orchestrator.building.native_build import build_native
from orchestrator.building.plain_c import LoopPart, plain_c
from orchestrator.building.sources import Recipe, recipe_of
from orchestrator.control.loops import ESTIMATES, FMUS, ControlTask, connections
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import Jacobi
from orchestrator.master.signals import Constant
from orchestrator.master.system import SignalSource, System
from orchestrator.records.model_text import toml_text
from orchestrator.scenarios.definition import Scenario
from orchestrator.scenarios.ssp.write import write_ssp
from orchestrator.shared.output import write_columns

CONTROLLERS = ("BacklashEstimator", "BacklashCompensator", "LqrController")
RECORD = ("plant.theta_l", "plant.theta_m", "plant.contact", "controller.u", "controller.flank", "estimator.alpha_hat")
DELAYS = {"estimator": 1.0, "controller": 2.0}  # further samples, in a host that steps all FMUs side by side


def write_loop(folder: Path, name: str, task: ControlTask, native: bool, fmi: int) -> None:
    """Write everything into a folder; FMUs have the suffix ``name``, and FMI 3 only where they are ``native``."""
    recipes = recipes_for(name, task)
    paths = {
        kind: build_native(recipe, folder, fmi)
        if native
        else build_variant(recipe.name, kind, dict(recipe.starts), folder)
        for kind, recipe in recipes.items()
    }
    angle, speed = task.reference()
    time = task.sample_time * np.arange(angle.size)
    write_columns(
        folder / "reference.csv", {"time": time, "reference": angle, "reference_speed": speed}, "{:.12g}".format
    )
    (folder / "loop.toml").write_text(scenario_text(task, {k: p.name for k, p in paths.items()}), encoding="utf-8")
    tables = (
        f"[{kind}]\n" + "".join(f'"{k}" = {toml_text(v)}\n' for k, v in start.items())
        for kind, start in task.settings().items()
    )
    (folder / "controller.toml").write_text("\n".join(tables), encoding="utf-8")
    write_ssp(folder / "loop.ssp", step_scenario(task, paths), f"{fmi - 1}.0")  # SSP 1.0 is for FMI 2.0
    for file, text in c_files(name, task).items():
        (folder / file).write_text(text, encoding="utf-8")


def file_names(name: str) -> tuple[str, ...]:
    """Return the names of the files that :func:`write_loop` writes."""
    fmus = (f"{kind}_{name}.fmu" for kind in ("Drivetrain", *CONTROLLERS))
    code = (f"controller_{name}.{end}" for end in ("h", "c"))
    return (*fmus, "loop.toml", "reference.csv", "controller.toml", "loop.ssp", *code)


def recipes_for(name: str, task: ControlTask) -> dict[str, Recipe]:
    """Return the recipes of plant and controllers with this machine's start values, by name of the plain FMU."""
    starts: dict[str, Mapping[str, float]] = {"Drivetrain": task.machine.plant(), **task.settings()}
    return {
        kind: replace(recipe_of(kind), name=f"{kind}_{name}", starts=starts[kind])
        for kind in ("Drivetrain", *CONTROLLERS)
    }


def scenario_text(task: ControlTask, files: Mapping[str, str]) -> str:
    """Return the TOML of the loop with the corrected plant, encoders with counts and noise, and the move."""
    machine = task.machine
    lines = ["# The loop with the machine as it was identified."]
    lines += [f"stop = {toml_text(task.stop)}", f"record = {toml_text(RECORD)}", "", "[master]"]
    lines += ['algorithm = "gauss_seidel"', f"step = {toml_text(task.sample_time)}"]
    for instance, kind in zip(("plant", "estimator", "controller"), FMUS, strict=True):
        lines += ["", f"[instances.{instance}]", f"fmu = {toml_text(files[kind])}"]
    for one in connections(machine, True):
        lines += ["", "[[connections]]", f"from = {toml_text(one.source)}", f"to = {toml_text(one.target)}"]
        lines += [f"quantum = {toml_text(one.quantum)}"] if one.quantum else []
    for name in ("reference", "reference_speed"):
        lines += ["", "[[sources]]", f'to = "controller.{name}"', 'kind = "table"', 'file = "reference.csv"']
        lines += [f'column = "{name}"', "hold = true"]
    for n, angle in enumerate(("theta_m", "theta_l")):
        if deviation := machine.white_noise(n):
            lines += ["", "[[sources]]", f'to = "estimator.{angle}"', 'kind = "noise"']
            lines += [f"deviation = {toml_text(deviation)}", f"seed = {n + 1}"]
    return "\n".join(lines) + "\n"


def step_scenario(task: ControlTask, fmus: Mapping[str, Path]) -> Scenario:
    """Return a step of the loop for hosts of SSP files, which step all FMUs side by side, with constant sources."""
    late = task.machine.delay(task.sample_time)
    instances = tuple(
        fmu_instance(part, fmus[kind], {"delay": late + DELAYS[part]} if part in DELAYS else {})
        for part, kind in zip(("plant", "estimator", "controller"), FMUS, strict=True)
    )
    wires = tuple(replace(one, quantum=0.0) for one in connections(task.machine, True))
    sources = (SignalSource("controller.reference", Constant(task.height)),)
    return Scenario(System(instances, wires, sources), RECORD, Jacobi(task.sample_time), task.stop, name="loop")


def c_files(name: str, task: ControlTask) -> dict[str, str]:
    """Return header and source of estimator and compensator in plain C."""
    recipes = recipes_for(name, task)
    given = {
        "theta_m": "measured angle of the motor [rad]",
        "theta_l": "measured angle of the load [rad]",
        "reference": "wanted angle of the load [rad]",
        "reference_speed": "wanted speed of the load [rad/s]",
    }
    told = (*(f"{one}_hat" for one in ESTIMATES), "alpha_hat", "alpha_deviation")
    parts = (
        LoopPart(
            "estimator", recipes["BacklashEstimator"], {"u": "controller.u", "theta_m": "theta_m", "theta_l": "theta_l"}
        ),
        LoopPart(
            "controller",
            recipes["BacklashCompensator"],
            {"reference": "reference", "reference_speed": "reference_speed"} | {n: f"estimator.{n}" for n in told},
        ),
    )
    outputs = {"u": "controller.u", "flank": "controller.flank"}
    outputs |= {n: f"estimator.{n}" for n in ("theta_l_hat", "omega_l_hat", "T_l_hat", "alpha_hat", "alpha_deviation")}
    return plain_c(
        f"controller_{name}", f"Estimator and compensator of the gap of {name}", parts, given, outputs, task.sample_time
    )
