"""Foreign FMUs of four domains in C, which solve by Runge-Kutta steps of their own; maps and a scenario for them."""

import functools
import subprocess
import tempfile
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

import fmpy

from tests.support.c_fmu import PLATFORM, SUFFIX

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Domain:
    """One model: its number in C, variables with units, nominal parameters, sampling, drive and noise."""

    number: int
    name: str
    parameters: dict
    input: tuple
    outputs: tuple  # (name, unit)
    port: tuple  # input, position, velocity or None
    h: float
    drive: float
    noise: tuple
    units: dict = field(default_factory=dict)
    effects: tuple = ()
    offset: float = 0.0
    further: tuple = ()  # a second input


SERIES = ("input_delay", "input_saturation", "input_dead_zone", "input_lag")
DOMAINS = (
    Domain(0, "Spring", {"m": (1.0, "kg"), "k": (20.0, "N/m"), "c": (0.8, "N.s/m")}, ("F", "N"),
           (("x", "m"),), ("F", "x", None), 0.01, 6.0, (2e-4,),
           effects=(*SERIES, "coulomb_friction", "quadratic_drag", "hardening_spring")),
    Domain(1, "TwoMass", {"J1": (0.02, "kg.m2"), "J2": (0.05, "kg.m2"), "k": (60.0, "N.m/rad"),
                          "c": (0.05, "N.m.s/rad"), "b": (0.04, "N.m.s/rad")}, ("M", "N.m"),
           (("phi1", "rad"), ("phi2", "rad")), ("M", "phi1", None), 0.005, 0.7, (3e-4, 3e-4),
           effects=(*SERIES, "coulomb_friction", "quadratic_drag", "gravity", "load")),
    Domain(2, "Circuit", {"L": (0.5, "H"), "R": (2.0, "Ohm"), "C": (0.02, "F")}, ("U", "V"),
           (("q", "C"),), ("U", "q", None), 0.02, 10.0, (3e-4,),
           effects=(*SERIES, "quadratic_drag")),
    Domain(3, "Tanks", {"A1": (1.5, "m2"), "A2": (1.0, "m2"), "k1": (0.02, "m2.5/s"), "k2": (0.03, "m2.5/s")},
           ("qin", "m3/s"), (("h1", "m"), ("h2", "m")), ("qin", "h1", None), 2.0, 0.02, (1e-3, 1e-3),
           effects=("input_delay", "input_saturation", "input_lag"), offset=1.0),
)  # fmt: skip
MOTOR = Domain(4, "Motor", {"J": (0.02, "kg.m2"), "b": (0.04, "N.m.s/rad")}, ("M", "N.m"),
               (("phi", "rad"), ("w", "rad/s")), ("M", "phi", None), 0.005, 0.7, (3e-4,),
               further=("T", "N.m"))  # fmt: skip
LOAD = Domain(5, "Load", {"J": (0.05, "kg.m2"), "k": (60.0, "N.m/rad"), "d": (0.4, "N.m.s/rad")}, ("phi_in", "rad"),
              (("phi", "rad"), ("T", "N.m")), ("phi_in", "phi", None), 0.005, 0.7, (3e-4,))  # fmt: skip
ALL_OUTPUTS = {0: ("x", "v"), 1: ("phi1", "phi2"), 2: ("q", "i"), 3: ("h1", "h2"), 4: ("phi", "w"), 5: ("phi", "T")}


@functools.cache
def library(number: int, fault: str = "") -> bytes:
    """Compile one model, broken where ``fault`` names how."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / f"Box{SUFFIX}"
        flags = [f"-DMODEL={number}", *([f"-DFAULT_{fault}"] if fault else [])]
        include = str(Path(fmpy.__file__).parent / "c-code")
        command = ["cc", "-std=gnu11", "-O2", "-w", "-shared", "-fPIC", *flags, "-I", include]
        subprocess.run([*command, str(HERE / "box_fmu.c"), "-lm", "-o", str(target)], check=True, capture_output=True)
        return target.read_bytes()


def write_fmu(path: Path, domain: Domain, fault: str = "") -> Path:
    """Write an FMU of a domain."""
    inputs = [domain.input, *([domain.further] if domain.further else [])]
    units = {u for _, u in domain.parameters.values()} | {u for _, u in inputs} | {u for _, u in domain.outputs}
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    lines.append(
        f'<fmiModelDescription fmiVersion="2.0" modelName="{domain.name}" guid="{{{domain.name}}}" '
        'generationTool="tests">'
    )
    lines.append('<CoSimulation modelIdentifier="Box" canHandleVariableCommunicationStepSize="true"/>')
    base = {"rad": ' rad="1"', "m": ' m="1"', "N": ' kg="1" m="1" s="-2"', "N.m": ' kg="1" m="2" s="-2"'}
    lines.append("<UnitDefinitions>")
    lines += [f'<Unit name="{u}">' + (f"<BaseUnit{base[u]}/>" if u in base else "") + "</Unit>" for u in sorted(units)]
    lines.append("</UnitDefinitions><ModelVariables>")
    reference = 0
    for name, (value, unit) in domain.parameters.items():
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="parameter" variability="tunable" '
            f'initial="exact"><Real unit="{unit}" start="{value}"/></ScalarVariable>'
        )
        reference += 1
    for name, unit in inputs:
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="input">'
            f'<Real unit="{unit}" start="0"/></ScalarVariable>'
        )
        reference += 1
    shown = dict(domain.outputs)
    for name in ALL_OUTPUTS[domain.number]:
        unit = f' unit="{shown[name]}"' if name in shown else ""
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="output"><Real{unit}/>'
            "</ScalarVariable>"
        )
        reference += 1
    count = len(domain.parameters) + len(inputs) + 1
    unknowns = "".join(f'<Unknown index="{count + k}"/>' for k in range(len(ALL_OUTPUTS[domain.number])))
    lines.append(
        f"</ModelVariables><ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", "\n".join(lines))
        archive.writestr(f"binaries/{PLATFORM}/Box{SUFFIX}", library(domain.number, fault))
    return path


def write_map(path: Path, domain: Domain, noise: bool = True) -> Path:
    """Write the map that a user would."""
    lines = ["[inputs]", f'{domain.input[0]} = {{ hold = "zero" }}', "[outputs]"]
    for (name, _), sigma in zip(domain.outputs, domain.noise, strict=True):
        lines.append(f"{name} = {{ noise = {sigma} }}" if noise else f"{name} = {{}}")
    lines += ["[parameters]", *(f'{name} = {{ uncertainty = "5 %" }}' for name in domain.parameters)]
    lines += ["[ports.port]", f'input = "{domain.port[0]}"', f'position = "{domain.port[1]}"']
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


SCENARIO = """
stop = 1.0
record = ["motor.phi"]
master = { algorithm = "gauss_seidel", step = 1e-3 }
[instances.motor]
fmu = "Motor.fmu"
[instances.load]
fmu = "Load.fmu"
[[connections]]
from = "motor.phi"
to = "load.phi_in"
[[connections]]
from = "load.T"
to = "motor.T"
"""
SCENARIO_MAP = """
[inputs]
"motor.M" = { column = "M" }
[outputs]
"motor.phi" = { column = "phi_m", noise = 3e-4 }
"load.phi" = { column = "phi_l", noise = 3e-4 }
[parameters]
"motor.J" = { uncertainty = "5 %" }
"motor.b" = { uncertainty = "5 %" }
"load.J" = { uncertainty = "5 %" }
"load.d" = { uncertainty = "5 %" }
[ports.motor]
input = "motor.M"
position = "motor.phi"
[cuts.coupling]
input = "load.phi_in"
far = "load.phi"
effort = "load.T"
"""


def write_scenario(folder: Path) -> tuple[Path, Path]:
    """Write two FMUs, a motor and a load behind a shaft, the scenario that connects them, and a map."""
    for domain in (MOTOR, LOAD):
        write_fmu(folder / f"{domain.name}.fmu", domain)
    (folder / "loop.toml").write_text(SCENARIO, encoding="utf-8")
    (folder / "loop_map.toml").write_text(SCENARIO_MAP, encoding="utf-8")
    return folder / "loop.toml", folder / "loop_map.toml"
