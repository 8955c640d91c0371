"""Advice in errors about scenarios and packages: each is given, and works when it is followed."""

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from orchestrator.api.simulate import simulate
from orchestrator.cli import main
from orchestrator.errors import OrchestratorError
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
TEXT = (
    'stop = 1.0\nrecord = ["a.x"]\n[master]\nalgorithm = "jacobi"\nstep = 0.1\n[instances.a]\nfmu = "Answers.fmu"\n'
    '[[sources]]\nto = "{}"\nkind = "constant"\nvalue = {}\n'
)


def scenario(folder: Path, target: str = "a.u", value: str = "1.0") -> Path:
    build_answers_fmu(folder)
    (folder / "run.toml").write_text(TEXT.format(target, value))
    return folder / "run.toml"


def directory(folder: Path) -> None:
    assert main(["ssp", "export", "--scenario", str(scenario(folder)), "--out", str(folder / "out")]) == 0
    with zipfile.ZipFile(folder / "out" / "run.ssp") as archive:
        archive.extractall(folder / "content")
    simulate((folder / "content").rename(folder / "content.ssp"))


def zipped(folder: Path) -> None:
    content = (folder / "content.ssp").rename(folder / "content")
    shutil.make_archive(str(folder / "made"), "zip", content)
    assert simulate((folder / "made.zip").rename(folder / "made.ssp")).steps == 10


CASES: tuple[tuple[str, Callable[[Path], object], Callable[[Path], object]], ...] = (
    ("is a directory; zip what is in it", directory, zipped),
    (
        "`step` must be left out with a TOML scenario, which says it itself",
        lambda folder: simulate(scenario(folder), step=0.2),
        lambda folder: simulate(scenario(folder)),
    ),
    (
        "must be a constant, a step, a square or a table with hold = true",
        lambda folder: simulate(sine(folder)),
        lambda folder: simulate(scenario(folder, "a.mode", "2")),
    ),
    (
        "must be true or false (1 or 0) at all times, but is 3",
        lambda folder: simulate(scenario(folder, "a.on", "3")),
        lambda folder: simulate(scenario(folder, "a.on", "true")),
    ),
)


def sine(folder: Path) -> Path:
    path = scenario(folder, "a.mode", "2")
    changed = path.read_text().replace('"constant"\nvalue = 2', '"sine"\namplitude = 1.0\nfrequency = 1.0')
    path.write_text(changed)
    return path


@pytest.mark.parametrize(("advice", "wrong", "follow"), CASES, ids=[case[0][:30] for case in CASES])
def test_advice_works(
    tmp_path: Path, advice: str, wrong: Callable[[Path], object], follow: Callable[[Path], object]
) -> None:
    with pytest.raises(OrchestratorError) as error:
        wrong(tmp_path)
    assert advice in str(error.value)
    follow(tmp_path)
