"""C hosts for native FMUs on this and other platforms: Linux on ARM by qemu, Windows by wine."""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from tests.support.waiting import HANGS

HOST = Path(__file__).with_name("step_host.c")
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
OUTPUTS = 6


class StepHost:
    """A compiled host for one platform and the command that runs it.

    Args:
        folder: where it is compiled.
        platform: "linux64", "aarch64-linux" or "win64".
    """

    def __init__(self, folder: Path, platform: str) -> None:
        self.platform = platform
        zig = [sys.executable, "-m", "ziglang", "cc"]
        program = folder / f"step_host_{platform}.exe"
        compilers = {
            "linux64": [shutil.which("cc") or "cc", "-ldl"],
            "aarch64-linux": [*zig, "-target", "aarch64-linux-gnu.2.28", "-ldl"],
            "win64": [*zig, "-target", "x86_64-windows-gnu"],
        }
        command = compilers[platform]
        subprocess.run([*command, "-std=c11", "-D_GNU_SOURCE", "-O2", "-o", str(program), str(HOST)], check=True)
        prefixes = {
            "linux64": [],
            "aarch64-linux": ["qemu-aarch64", "-L", str(ARM_LIBRARIES)],
            "win64": ["/usr/lib/wine/wine64" if Path("/usr/lib/wine/wine64").exists() else "wine64"],
        }
        self.command = [*prefixes[platform], str(program)]
        self.suffix = "dll" if platform == "win64" else "so"

    def run(
        self,
        fmu: Path,
        steps: int,
        step: float,
        amplitude: float,
        frequency: float,
        parameters: dict[str, float],
        timed: int = 1,
        outputs: int = OUTPUTS,
    ) -> list[str]:
        """Return what the host printed, word by word; see ``step_host.c``."""
        folder = fmu.parent / f"{fmu.stem}-extracted"
        with zipfile.ZipFile(fmu) as archive:
            description = archive.read("modelDescription.xml").decode()
            archive.extractall(folder)
        guid = re.search(r'guid="([^"]*)"', description)
        assert guid is not None
        words = []
        for name, value in parameters.items():
            found = re.search(rf'name="{re.escape(name)}" valueReference="(\d+)".*?<(\w+)', description, re.DOTALL)
            assert found is not None
            words.append(f"{'' if found[2] == 'Real' else 'i:'}{found[1]}={value!r}")
        library = folder / "binaries" / self.platform / f"{fmu.stem}.{self.suffix}"
        arguments = [library, guid[1], steps, step, amplitude, frequency, outputs, timed]
        command = [*self.command, *map(str, arguments), *words]
        run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=HANGS)
        return run.stdout.split()


def last_outputs(words: list[str]) -> list[float]:
    """Return the last outputs that a host printed."""
    return [float.fromhex(word) for word in words[6:]]
