"""The effect FMUs of a corrected system: which there are, their values, and how the FMU is built."""

import hashlib
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pyfmu_sources
from orchestrator.diagnosis.fmu.bank import CUT, PARAMETER, PORT, BoxEffect
from orchestrator.diagnosis.fmu.model import BoxModel
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.errors import FmuError
from pyfmu_sources.attachment import SERIES

BUILD = (
    "import sys; from pythonfmu import FmuBuilder; "
    "FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2], project_files=sys.argv[3:])"
)


@dataclass(frozen=True)
class Part:
    """One effect FMU of the system: its name, the effect, and the values it is given.

    Without an effect it hands a value from one FMU to another, extrapolated as in the fit.
    """

    name: str
    effect: BoxEffect | None
    values: dict[str, float | int | bool]

    @property
    def where(self) -> str:
        """Where it acts; empty: between two FMUs, with no effect."""
        return "" if self.effect is None else self.effect.kind.where

    @property
    def place(self) -> str:
        """The input, output, port, parameter or cut that it acts at."""
        return "" if self.effect is None else self.effect.place


def build_effect_fmu(folder: Path) -> Path:
    """Return the effect FMU, built in ``folder`` from the laws' own source, its modules named by their content."""
    sources = Path(pyfmu_sources.__file__).parent
    laws, slave = ((sources / f"{name}.py").read_text(encoding="utf-8") for name in ("port_laws", "attachment"))
    digest = hashlib.sha256((laws + slave).encode()).hexdigest()[:16]
    (folder / f"port_laws_{digest}.py").write_text(laws, encoding="utf-8")
    script = folder / f"attachment_{digest}.py"
    script.write_text(slave.replace("from .port_laws import", f"from port_laws_{digest} import"), encoding="utf-8")
    target = folder / "built"
    target.mkdir()
    run = subprocess.run(
        [sys.executable, "-c", BUILD, str(script), str(target), str(folder / f"port_laws_{digest}.py")],
        capture_output=True, text=True, check=False, cwd=folder,
    )  # fmt: skip
    found = sorted(target.glob("*.fmu"))
    if run.returncode != 0 or not found:
        lines = run.stderr.strip().splitlines() or ["no message"]
        raise FmuError(f"cannot build the effect FMU: {lines[-1]}")
    return found[0]


def parts_of(problem: BoxProblem, model: BoxModel) -> tuple[Part, ...]:
    """Return the effect FMUs of a corrected model."""
    found = []
    for k, c in enumerate(problem.runner.subject.connections):
        at_once = [t for t in problem.runner.through if t.wire == k]
        if len(at_once) > 1:
            raise FmuError(
                f"{c.source} must depend directly on at most one connection to be written as SSP, but depends on more"
            )
        gain = sum(t.gain for t in at_once)
        values = {"series": SERIES.index("connection"), "q0": c.factor, "q1": c.offset, "q2": gain, "lead": 0.5}
        found.append(Part(f"connection_{k + 1}", None, values))
    for k, (effect, fitted) in enumerate(zip(model.effects, model.values, strict=True)):
        given: dict[str, float | int | bool] = {f"q{n}": float(v) for n, v in enumerate(fitted)}
        if effect.kind.where == PORT:
            given |= {"series": -1, "law": effect.kind.law, "sign": problem.sign.get(effect.place, 1.0), "lead": 0.5}
            given["has_velocity"] = problem.map.ports[effect.place].velocity is not None
        elif effect.kind.where == CUT:
            given |= {"series": -1, "law": effect.kind.law, "sign": problem.sign.get(effect.place, 1.0), "lead": 0.5}
        elif effect.kind.where == PARAMETER:
            given |= {"series": SERIES.index(effect.kind.name.partition("_")[2])}
            given |= {"q1": float(problem.starts(model)[effect.place]), "q2": float(problem.data.time[0])}
            if effect.signal:
                given["q2"] = problem.map.signals[effect.signal].reference
        else:
            given |= {"series": SERIES.index(effect.kind.name.partition("_")[2]), "law": 0, "at_rest": effect.at_rest}
            if effect.kind.name == "output_delay":
                given |= {"series": SERIES.index("late_reading"), "q1": float(problem.m)}
        found.append(Part(f"{effect.kind.name}_{k + 1}", effect, given))
    return tuple(found)
