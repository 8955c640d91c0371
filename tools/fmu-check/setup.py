"""Builds the distribution: the parts of ``orchestrator`` that check FMUs, below a package of their own.

They are copied out of the repository around this folder, so there is no source archive. Below ``fmu_check`` they meet
no other installed package of the same name.
"""

import re
import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

REPOSITORY = Path(__file__).resolve().parents[2]
PARTS = (
    "LICENSE",
    "orchestrator/__init__.py",
    "orchestrator/__init__.pyi",
    "orchestrator/__main__.py",
    "orchestrator/errors.py",
    "orchestrator/plain_text.py",
    "orchestrator/building/__init__.py",
    "orchestrator/building/archive.py",
    "orchestrator/building/launcher.py",
    "orchestrator/building/native/*",
    "orchestrator/checking/**/*.py",
    "orchestrator/commands/__init__.py",
    "orchestrator/commands/_check.py",
    "orchestrator/commands/_fmu_check.py",
    "orchestrator/commands/_lines.py",
    "orchestrator/commands/_outcome.py",
    "orchestrator/commands/_parser.py",
    "orchestrator/commands/_progress_lines.py",
    "orchestrator/commands/_trust.py",
    "orchestrator/shared/*.py",
    "orchestrator/shared/isolation/*.py",
    "orchestrator/shared/results/__init__.py",
    "orchestrator/shared/results/fields.py",
)


class Build(build_py):
    """Copies the parts beside the package."""

    def run(self) -> None:
        """Copy; what an earlier build left is removed."""
        shutil.rmtree(Path(self.build_lib) / "fmu_check", ignore_errors=True)
        super().run()
        for part in PARTS:
            found = sorted(REPOSITORY.glob(part))
            if not found:
                raise FileNotFoundError(f"{part}: no such file in {REPOSITORY}, which must be the whole repository")
            for path in found:
                target = Path(self.build_lib) / "fmu_check" / "code" / path.relative_to(REPOSITORY)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, target)


source = (REPOSITORY / "orchestrator" / "shared" / "version.py").read_text(encoding="utf-8")
version = re.search(r'__version__ = "(.+)"', source)
assert version is not None
# Not beside the sources, where it would stay, and meet a build of another process.
with tempfile.TemporaryDirectory() as folder:
    options = {"build": {"build_base": folder}, "egg_info": {"egg_base": folder}}
    setup(version=version[1], cmdclass={"build_py": Build}, options=options)
