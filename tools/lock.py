"""Writes ``requirements.lock``: every package that an installation with all extras for tests takes, with hashes.

Another one, beside it in ``tools/fmu-check``, has what the checker alone needs, and what builds it.

    python -m tools.lock              # needs uv
    pip install --require-hashes -r requirements.lock && pip install --no-deps -e .

The lock holds for every Python and system that the project supports. CI installs from it once, beside the newest and
the oldest versions that ``pyproject.toml`` allows.
"""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from tools import refuse_arguments

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Resolve and write."""
    tool = shutil.which("uv") or str(Path(sys.executable).with_name("uv"))
    checker = ROOT / "tools" / "fmu-check"
    building = tomllib.loads((checker / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    common = ["--universal", "--python-version", "3.11", "--generate-hashes", "--no-emit-index-url", "--no-header"]
    for folder, options, more in ((ROOT, ["--extra", "test"], []), (checker, ["-"], building)):
        command = [
            tool, "pip", "compile", "pyproject.toml", *options, *common, "--no-annotate", "--quiet", "--output-file",
            "requirements.lock",
        ]  # fmt: skip
        given = "\n".join(more)
        done = subprocess.run(command, cwd=folder, input=given, text=True, check=False, stdout=subprocess.DEVNULL)
        if done.returncode:
            return done.returncode
    return 0


if __name__ == "__main__":
    refuse_arguments(__doc__)
    sys.exit(main())
