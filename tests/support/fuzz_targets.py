"""What is fuzzed: readers of all that a user can be handed. Any bytes must give a result or an error in one line.

A target is a function of the file's content; it returns whether it was accepted. Whatever it raises is a finding.
"""

import io
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from orchestrator.api.ssp import export_ssp
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.diagnosis.fmu.mapping import read_map
from orchestrator.diagnosis.fmu.system import read_system
from orchestrator.errors import OrchestratorError
from orchestrator.fmi.model_description import read_description
from orchestrator.records.model_file import read_model
from orchestrator.records.record import read_record
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.ssp.read import open_ssp
from tests.scenarios.test_scenario import GOOD, LOOP
from tests.support import dialects
from tests.support.c_fmu import IDENTIFIER, fmu_files, write_fmu
from tests.support.hostile_fmus import MAP, SCENARIO

ROWS = 210
VALUES = "resources/slave.ssv"
MODEL = b"""fmu = "Drivetrain"
[parameters.J_l]
value = 5.6
relative_uncertainty = 0.05
[encoders.theta_m]
counts_per_rev = 10000
[columns.theta_l]
name = "theta_l"
unit = "rad"
[columns.u]
unit = "N.m"
factor = 1.0
"""


@cache
def _folder() -> Path:
    """A folder of this process with a small FMU in it."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    write_fmu(folder / f"{IDENTIFIER}.fmu", fmu_files())
    (folder / "torque.csv").write_text("time,u\n0,0\n0.01,5\n0.02,5\n")
    return folder


def _case(data: bytes, name: str = "case") -> Path:
    path = _folder() / name
    path.write_bytes(data)
    return path


@contextmanager
def _errors_of_ours(accepted: list[bool]):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", DeprecationWarning)  # of libraries
            yield
        accepted.append(True)
    except OrchestratorError as error:
        text = str(error)
        assert text, "no text"
        assert "\n" not in text, f"more than one line: {text!r}"


def record(data: bytes) -> bool:
    """A measured record, in whatever format its content is."""
    accepted: list[bool] = []
    with _errors_of_ours(accepted):
        read_record(_case(data))
    return bool(accepted)


def model(data: bytes) -> bool:
    """A model file."""
    accepted: list[bool] = []
    with _errors_of_ours(accepted):
        read_model(_case(data, "model.toml"))
    return bool(accepted)


def map_file(data: bytes) -> bool:
    """A map of any FMU."""
    accepted: list[bool] = []
    with _errors_of_ours(accepted):
        read_map(_case(data, "map.toml"), read_system(_folder() / f"{IDENTIFIER}.fmu"))
    return bool(accepted)


def scenario(data: bytes) -> bool:
    """A scenario file."""
    accepted: list[bool] = []
    with _errors_of_ours(accepted):
        load_scenario(_case(data, "scenario.toml"))
    return bool(accepted)


def ssp(data: bytes) -> bool:
    """An SSP file."""
    accepted: list[bool] = []
    with _errors_of_ours(accepted), open_ssp(_case(data, "case.ssp")):
        pass
    return bool(accepted)


def ssd(data: bytes) -> bool:
    """The system structure in an SSP file."""
    return ssp(_zip(_ssp_members() | {"SystemStructure.ssd": data}))


def ssv(data: bytes) -> bool:
    """The parameter values in an SSP file."""
    return ssp(_zip(_ssp_members() | {VALUES: data}))


def archive(data: bytes) -> bool:
    """An FMU, as an archive; nothing of it is run."""
    return _checked(_case(data, "case.fmu"))


def description(data: bytes) -> bool:
    """The model description of an FMU."""
    return _checked(_case(_zip({"modelDescription.xml": data}), "case.fmu"))


def _checked(path: Path) -> bool:
    accepted: list[bool] = []
    with _errors_of_ours(accepted):
        found = check_fmu(path, CheckOptions(static=True))
        assert all(f.message and "\n" not in f.message for f in found.findings)
        assert not any(f.rule == "run.failed" for f in found.findings)
    with _errors_of_ours([]):
        read_description(path)
    return bool(accepted) and not found.findings


@cache
def _ssp_members() -> dict[str, bytes]:
    folder = _folder()
    (folder / "export.toml").write_text(SCENARIO.format(fmu=f"{IDENTIFIER}.fmu"))
    export_ssp(folder / "export.ssp", folder / "export.toml")
    with zipfile.ZipFile(folder / "export.ssp") as found:
        return {name: found.read(name) for name in found.namelist()}


def _zip(members: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_STORED) as found:
        for name, data in members.items():
            found.writestr(name, data)
    return made.getvalue()


def _columns() -> dict[str, np.ndarray]:
    time = 0.001 * np.arange(ROWS)
    motor = 0.3 * np.sin(40.0 * time) + 2.0 * time
    return {"time": time, "u": np.sin(30.0 * time), "theta_m": motor, "theta_l": motor / 4.0}


def record_seeds() -> dict[str, bytes]:
    """A short record in each dialect whose reader runs in this process: coverage is seen there alone.

    The others are fuzzed by ``benchmarks.fuzz_readers``.
    """
    found = {}
    with tempfile.TemporaryDirectory() as name:
        for write in dialects.DIALECTS:
            found[write.__name__] = write(Path(name), _columns())[0].read_bytes()
    return {name: data for name, data in found.items() if not data.startswith((b"MATLAB", b"MDF", b"PAR1"))}


def seeds(target: str) -> dict[str, bytes]:
    """Good files for a target, by name."""
    match target:
        case "record":
            return record_seeds()
        case "model":
            return {"model": MODEL}
        case "map_file":
            return {"map": MAP.encode()}
        case "scenario":
            return {"good": GOOD.encode(), "loop": LOOP.encode()}
        case "ssd":
            return {"ssd": _ssp_members()["SystemStructure.ssd"]}
        case "ssv":
            return {"ssv": _ssp_members()[VALUES]}
        case "ssp":
            return {"ssp": _zip({k: v for k, v in _ssp_members().items() if len(v) < 100_000})}
        case "description":
            return {"description": fmu_files()["modelDescription.xml"]}
        case _:
            small = {n: d for n, d in fmu_files().items() if n.endswith((".xml", ".txt", ".html"))}
            return {"fmu": _zip(small)}


TARGETS: dict[str, Callable[[bytes], bool]] = {
    f.__name__: f for f in (record, model, map_file, scenario, ssp, ssd, ssv, archive, description)
}
