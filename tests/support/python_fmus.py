"""Python FMUs as others build them: PythonFMU's own command line around a source text."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.support.waiting import HANGS

SLAVE = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
{imports}
class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y, self.u, self.gain = 0.0, 0.0, 1.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=0.0))
        tunable = dict(causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        self.register_variable(Real("gain", start=1.0, **tunable))
{more}
    def do_step(self, time, step):
{step}
"""


def slave_source(step: str, imports: str = "", more: str = "", name: str = "Plant") -> str:
    """Return the source of a slave with output ``y``, input ``u`` and parameter ``gain``.

    Args:
        step: lines of ``do_step``.
        imports: lines at the head of the module.
        more: lines of ``__init__``.
    """
    texts = {
        key: "\n".join(" " * 8 + line for line in text.splitlines()) for key, text in (("step", step), ("more", more))
    }
    return SLAVE.format(name=name, imports=imports, **texts)


def build_python_fmu(folder: Path, source: str, files: Mapping[str, str] | None = None, module: str = "plant") -> Path:
    """Build an FMU in ``folder`` of a source text and further files of its own, and return its path."""
    work = folder / "sources"
    work.mkdir(parents=True)
    (work / f"{module}.py").write_text(source)
    for name, text in (files or {}).items():
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_text(text)
    projects = sorted({name.partition("/")[0] for name in files or {}})
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", f"{module}.py", "-d", str(folder.resolve()), *projects]
    subprocess.run(command, cwd=work, check=True, capture_output=True, timeout=HANGS)
    (path,) = folder.glob("*.fmu")
    return path
