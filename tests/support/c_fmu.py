"""A co-simulation FMU written in C, built by the tests: a mass on a spring, correct or with one fault.

It is a foreign FMU for everything that must work with FMUs that are not ours.
"""

import math
import shutil
import sys
import zipfile
from pathlib import Path

from tests.support.c_library import compile_source

HERE = Path(__file__).parent
GUID = "{7d1c6f0a-94e5-4a53-b1ce-0d6c3f4f8a11}"
IDENTIFIER = "MassSpring"
PLATFORM = {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}[sys.platform]
SUFFIX = {"linux": ".so", "win32": ".dll", "darwin": ".dylib"}[sys.platform]
LIBRARY = f"binaries/{PLATFORM}/{IDENTIFIER}{SUFFIX}"
REFERENCE = "extra/org.fmi-standard.fmi-ls-ref"


def have_compiler() -> bool:
    """Whether a C compiler is at hand."""
    return shutil.which("cc") is not None


def compile_library(behaviour: str = "good", guid: str = GUID) -> bytes:
    """Compile ``c_fmu.c`` with the fault ``behaviour`` ("good": none) and return the shared library."""
    faults = {"good": (), "hostile": ("HOSTILE", "_GNU_SOURCE")}
    return compile_source("c_fmu.c", f'FMU_GUID="{guid}"', *faults.get(behaviour, (f"FAULT_{behaviour}",)))


def model_description() -> str:
    """The modelDescription.xml of the correct FMU."""
    return (HERE / "c_fmu.xml").read_text(encoding="utf-8")


def reference_trajectory(stop: float = 0.5, step: float = 0.01) -> str:
    """The default experiment as CSV from the closed-form solution of the damped oscillator (force = 0)."""
    mass, stiffness, damping, x0, v0 = 1.0, 40.0, 0.8, 0.1, 0.0
    decay = damping / (2.0 * mass)
    omega = math.sqrt(stiffness / mass - decay**2)
    lines = ["time,x,v"]
    for n in range(round(stop / step) + 1):
        t = n * step
        a, b = x0, (v0 + decay * x0) / omega
        cos, sin, envelope = math.cos(omega * t), math.sin(omega * t), math.exp(-decay * t)
        x = envelope * (a * cos + b * sin)
        v = envelope * ((b * omega - decay * a) * cos - (a * omega + decay * b) * sin)
        lines.append(f"{t:.12g},{x:.15g},{v:.15g}")
    return "\n".join(lines) + "\n"


MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
    fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1"
    fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">
  <Related type="text/csv" source="MassSpring_out.csv" role="result" description="Output of the default experiment"/>
</fmiReferences>
"""


def fmu_files(behaviour: str = "good") -> dict[str, bytes]:
    """The files of the FMU by their path in the archive."""
    return {
        "modelDescription.xml": model_description().encode(),
        LIBRARY: compile_library(behaviour),
        "resources/readme.txt": b"nothing is needed here\n",
        "documentation/index.html": b"<!DOCTYPE html><title>MassSpring</title><p>A mass on a spring.</p>\n",
        f"{REFERENCE}/fmi-ls-manifest.xml": MANIFEST.encode(),
        f"{REFERENCE}/MassSpring_out.csv": reference_trajectory().encode(),
    }


def write_fmu(path: Path, files: dict[str, bytes]) -> Path:
    """Pack ``files`` into the FMU ``path`` with fixed times."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, (2024, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return path


def build_c_fmu(directory: Path, behaviour: str = "good", name: str = IDENTIFIER) -> Path:
    """Build the FMU into ``directory`` and return its path.

    Args:
        behaviour: "good", or the name of a ``FAULT_`` macro in ``c_fmu.c``.
        name: stem of the file.
    """
    return write_fmu(Path(directory) / f"{name}.fmu", fmu_files(behaviour))
