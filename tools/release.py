"""Makes the artefacts of a release in ``dist/``: source archive, wheels, software bill of materials, SHA-256 sums.

    python -m tools.release           # needs cyclonedx-bom, and setuptools and ziglang of requirements.lock

They are made of the last commit alone, in a folder of their own, and are the same to the byte for the same commit and
the same setuptools and zig: times are those of the commit, owners and rights are fixed, members are sorted. The
wheels are built from the source archive: one with kernels in machine code for each platform, and one without, for all
others. ``sha256sum -c SHA256SUMS`` in ``dist/`` checks all files.
"""

import gzip
import hashlib
import io
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterable
from pathlib import Path

from orchestrator.building.installing import PLATFORMS
from tools import refuse_arguments

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
_BACKEND = "import setuptools.build_meta as b, sys; print(getattr(b, sys.argv[1])(sys.argv[2]))"
_FOR_PLATFORM = (
    "import orchestrator.building.installing as b, sys; print(b.build_wheel(sys.argv[2], {'platform': sys.argv[3]}))"
)


def commit_time(root: Path) -> int:
    """Seconds since 1970 of the last commit of a checkout."""
    words = ["git", "log", "-1", "--format=%ct"]
    return int(subprocess.run(words, cwd=root, check=True, capture_output=True, text=True).stdout)


def committed(root: Path, folder: Path, commit: str = "HEAD") -> Path:
    """Unpack a commit of a checkout, by default its last one, into ``folder`` and return it."""
    words = ["git", "archive", "--format=tar", commit]
    archive = subprocess.run(words, cwd=root, check=True, capture_output=True).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as found:
        found.extractall(folder, filter=_plain)
    return folder


def build(source: Path, out: Path, time: int, platforms: Iterable[str] = ()) -> list[Path]:
    """Make source archive and wheels of a folder of sources.

    Args:
        source: what is packed; the build leaves its own files there.
        out: where the two go.
        time: of all that is in them, in seconds since 1970.
        platforms: that get a wheel with machine code.

    Returns:
        The source archive and the wheels, that for all platforms first.
    """
    out.mkdir(parents=True, exist_ok=True)
    archive = _hook("build_sdist", source, out, time)
    _normalise(archive, time)
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(archive) as found:
            found.extractall(folder, filter=_plain)
        (unpacked,) = Path(folder).iterdir()
        wheels = [_hook("build_wheel", unpacked, out, time, *name) for name in ([], *([name] for name in platforms))]
    return [archive, *wheels]


def _hook(name: str, source: Path, out: Path, time: int, *platform: str) -> Path:
    """Call a function of the build backend, in a process whose files are readable by all."""
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(time), "PYTHONPATH": ""}
    words = [sys.executable, "-c", _FOR_PLATFORM if platform else _BACKEND, name, str(out), *platform]
    done = subprocess.run(words, cwd=source, env=environment, check=True, capture_output=True, text=True, umask=0o022)
    return out / done.stdout.split()[-1]


def _plain(member: tarfile.TarInfo, _: str = "") -> tarfile.TarInfo:
    """A member without what depends on who packed it."""
    rights = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
    return member.replace(mode=rights, uid=0, gid=0, uname="", gname="", deep=False)


def _normalise(path: Path, time: int) -> None:
    """Write an archive again: members sorted, with fixed times, owners and rights."""
    content = io.BytesIO()
    with tarfile.open(path) as old, tarfile.open(fileobj=content, mode="w", format=tarfile.PAX_FORMAT) as new:
        for member in sorted(old.getmembers(), key=lambda m: m.name):
            data = old.extractfile(member) if member.isfile() else None
            plain = _plain(member).replace(mtime=time, deep=False)
            plain.pax_headers = {}
            new.addfile(plain, data)
    path.write_bytes(gzip.compress(content.getvalue(), mtime=time))


def bill_of_materials() -> None:
    """Write what ``requirements.lock`` installs as CycloneDX JSON, the same for the same lock."""
    target = str(DIST / "sbom.cdx.json")
    options = ["--output-reproducible", "--pyproject", "pyproject.toml", "--output-format", "JSON"]
    words = ["cyclonedx_py", "requirements", "requirements.lock", *options, "--output-file", target]
    subprocess.run([sys.executable, "-m", *words], cwd=ROOT, check=True)


def sums() -> None:
    """Write the SHA-256 of every artefact."""
    files = sorted(p for p in DIST.iterdir() if p.is_file() and p.name != "SHA256SUMS")
    lines = [f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.name}\n" for p in files]
    (DIST / "SHA256SUMS").write_text("".join(lines), encoding="ascii")
    print("".join(lines), end="")


def main() -> int:
    """Make all of them in an empty ``dist/``."""
    if DIST.exists() and any(DIST.iterdir()):
        print(f"error: {DIST} must be empty, but is not", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        build(committed(ROOT, Path(folder) / "source"), DIST, commit_time(ROOT), PLATFORMS)
    bill_of_materials()
    sums()
    return 0


if __name__ == "__main__":
    refuse_arguments(__doc__)
    sys.exit(main())
