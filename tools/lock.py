"""Writes ``requirements.lock``: every package that an installation with all extras for tests takes, with hashes.

    python -m tools.lock              # needs uv
    pip install --require-hashes -r requirements.lock && pip install --no-deps -e .

The lock holds for every Python and system that the project supports. CI installs from it once, beside the newest and
the oldest versions that ``pyproject.toml`` allows.
"""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Resolve and write."""
    tool = shutil.which("uv") or str(Path(sys.executable).with_name("uv"))
    command = [
        tool, "pip", "compile", "pyproject.toml", "--extra", "test", "--universal", "--python-version", "3.11",
        "--generate-hashes", "--no-emit-index-url", "--no-header", "--no-annotate", "--quiet", "--output-file",
        "requirements.lock",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, check=False, stdout=subprocess.DEVNULL)
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
