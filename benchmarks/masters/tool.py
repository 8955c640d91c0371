"""What an adapter hands to the runner, and how an installed tool is found."""

import importlib.metadata
import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from benchmarks.masters.job import BenchJob

GAUSS_SEIDEL = "Gauss-Seidel"
JACOBI = "Jacobi"
JACOBI_READ_AGAIN = "Jacobi, outputs read again"


@dataclass(frozen=True)
class Prepared:
    """A job that is set up.

    Attributes:
        run: runs it once from start to stop; returns its time [s] if the tool has a clock of its own.
        ends: the ends of ``job.watched`` after a run, by name.
    """

    run: Callable[[], float | None]
    ends: Callable[[], Mapping[str, float]]


Prepare = Callable[[BenchJob], Prepared]


@dataclass(frozen=True)
class Tool:
    """A way to run a job.

    Attributes:
        needs: import name of the package, or ``program:NAME``; empty for what is always there.
        again: what it returns may be run more than once.
        scheme: order in which values are exchanged: a key of ``reference.SCHEMES``.
        fmi3: it takes FMUs of FMI 3.0 with arrays.
        package: under which the package is registered, when that is not its import name.
    """

    title: str
    needs: str
    prepare: Prepare
    again: bool
    scheme: str
    package: str = ""
    fmi3: bool = False

    @property
    def installed(self) -> bool:
        """Whether the tool is there, be it from a package registry or from sources."""
        kind, _, program = self.needs.rpartition(":")
        if kind == "program":
            return shutil.which(program) is not None
        return not self.needs or importlib.util.find_spec(self.needs) is not None

    def version(self) -> str:
        """Return the version; to be called once the tool was used, since what is built from sources must be asked."""
        kind, _, program = self.needs.rpartition(":")
        if kind == "program":
            words = subprocess.run([program, "--version"], capture_output=True, text=True, check=False).stdout
            found = re.search(r"\d+(\.\d+)+", words)
            return found.group() if found else ""
        if not self.needs:
            return ""
        try:
            return importlib.metadata.version(self.package or self.needs)
        except importlib.metadata.PackageNotFoundError:
            return str(getattr(sys.modules.get(self.needs), "__version__", "from sources"))
