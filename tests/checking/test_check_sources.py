"""Sources of an FMU: a compiler reads them, and sees nothing but them and itself."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.isolation.programs import run_program
from orchestrator.shared.isolation.surroundings import system_folders
from orchestrator.shared.isolation.walls import support
from tests.support.c_fmu import LIBRARY, fmu_files, have_compiler, write_fmu

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler() or not support().landlock, reason="needs a compiler and Landlock"
)
LIST = b'canHandleVariableCommunicationStepSize="true"'
QUICK = CheckOptions(probes=("life cycle",))


def sources(tmp_path: Path, text: str) -> Path:
    files = fmu_files()
    del files[LIBRARY]
    xml = files["modelDescription.xml"].decode()
    begin = xml.index("<CoSimulation")
    end = xml.index("/>", begin)
    xml = f'{xml[:end]}><SourceFiles><File name="model.c"/></SourceFiles></CoSimulation>{xml[end + 2 :]}'
    more = {"modelDescription.xml": xml.encode(), "sources/model.c": text.encode(), "sources/own.h": b"int own;\n"}
    return write_fmu(tmp_path / "sources.fmu", files | more)


def messages(path: Path, options: CheckOptions = QUICK) -> list[str]:
    report = check_fmu(path, options)
    assert not report.stages["sources"], report.stages["sources"]
    return [f.message for f in report.findings if f.rule == "build.compiles"]


def test_a_file_of_the_user_is_not_included(tmp_path: Path) -> None:
    secret = tmp_path / "private.h"
    secret.write_text("#error words of the user\n")
    path = sources(tmp_path, f'#include <stdio.h>\n#include "own.h"\n#include "{secret}"\n')
    assert messages(path) == []
    (told,) = messages(path, replace(QUICK, trust=True))
    assert "words of the user" in told  # where the user trusts it, the walls are down


def test_a_fault_is_told_with_its_line_and_a_missing_header_is_not_judged(tmp_path: Path) -> None:
    (told,) = messages(sources(tmp_path, '#include <math.h>\nint f(void) { return "x" * 2; }\n'))
    assert "./model.c:2:" in told
    assert messages(sources(tmp_path, "#include <of_a_target.h>\nwhatever it declares;\n")) == []


def test_a_program_behind_walls_has_its_limits(tmp_path: Path) -> None:
    folder, beside = tmp_path / "work", tmp_path / "beside.txt"
    folder.mkdir()
    beside.write_text("words of the user")
    read = [*system_folders(), Path("/bin"), Path("/usr/bin")]
    limits = Limits(time=3.0, memory=64 << 20, output=1 << 16)

    def run(script: str, time: float = 3.0) -> tuple[int, str] | None:
        return run_program(["/bin/sh", "-c", script], folder, read, dict(os.environ), replace(limits, time=time))

    assert run("echo some words > made.txt; cat made.txt") == (0, "some words\n")
    done = run(f"cat {beside}; echo more > {beside}")
    assert done is not None
    assert done[0] != 0
    assert "words of the user" not in done[1]
    assert beside.read_text() == "words of the user"
    assert run("sleep 60", time=0.5) is None
    assert run("ulimit -v; ulimit -f") == (0, f"{(2 * (64 << 20) + (1 << 30)) >> 10}\n128\n")
