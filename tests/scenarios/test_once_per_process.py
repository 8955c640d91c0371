"""An FMU that may be instantiated once per process, used more than once: each instance has a process."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.scenario_sweep import sweep_scenario
from orchestrator.api.simulate import simulate
from orchestrator.cli import main
from orchestrator.errors import OrchestratorError
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.shared_inputs import shared_input

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")


def scenario(folder: Path, *macros: str, once: bool = True, **kind: bool) -> Path:
    """Two integrators in a row, the second fed by the first."""
    more = f'canBeInstantiatedOnlyOncePerProcess="{str(once).lower()}"'
    build_answers_fmu(folder, *(["ONCE"] if once else []), *macros, more=more, **kind)
    path = folder / "two.toml"
    path.write_text(
        'stop = 1.0\nrecord = ["a.x", "b.x", "b.steps"]\n[master]\nalgorithm = "jacobi"\nstep = 0.05\n'
        '[instances.a]\nfmu = "Answers.fmu"\n[instances.b]\nfmu = "Answers.fmu"\nparameters = { gain = 3.0 }\n'
        '[[connections]]\nfrom = "a.x"\nto = "b.u"\n'
        '[[sources]]\nto = "a.u"\nkind = "constant"\nvalue = 1.0\n'
        '[[sources]]\nto = "b.mode"\nkind = "constant"\nvalue = 2\n'
    )
    return path


def test_the_numbers_are_those_of_one_process(tmp_path: Path) -> None:
    for name in ("once", "free"):
        (tmp_path / name).mkdir()
    together = simulate(scenario(tmp_path / "free", once=False))
    apart = simulate(scenario(tmp_path / "once"))
    assert np.array_equal(apart.run.values, together.run.values)
    assert apart["a.x"][-1] == pytest.approx(2.0)


def test_warnings_discards_and_an_early_end_are_told_across_processes(tmp_path: Path) -> None:
    for name in ("warns", "ends", "long"):
        (tmp_path / name).mkdir()
    warned = simulate(scenario(tmp_path / "warns", "WARNS_FROM=0.5"))
    assert [(r.instance, r.count) for r in warned.run.remarks] == [("a", 10), ("b", 10)]
    ended = simulate(scenario(tmp_path / "ends", "ENDS_AT=0.5"))
    assert ended.time[-1] == pytest.approx(0.5)
    short = simulate(scenario(tmp_path / "long", "LONGEST=0.03", saves=True))
    assert short["a.x"][-1] == pytest.approx(2.0)
    assert all("done in shorter steps" in r.text for r in short.run.remarks)


@pytest.mark.parametrize(
    ("macro", "said"),
    [
        ("HANGS", "a, do_step: the run must take at most 3 s (`--time-limit`), but takes longer"),
        ("DIES", "a, do_step: the run must come to its end, but the process was ended by SIGABRT"),
    ],
)
def test_how_a_process_ends_is_said_as_for_one_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], macro: str, said: str
) -> None:
    words = ["simulate", "--scenario", str(scenario(tmp_path, macro)), "--out", str(tmp_path / "out")]
    assert main([*words, "--time-limit", "3"]) == 1
    assert said in " ".join(capsys.readouterr().err.split())


def test_what_a_sweep_says_of_it_works(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    try:
        result = sweep_scenario(path, {"a.gain": "range:1:2:2"}, workers=1)
        said = " ".join(row.outcome.message for row in result.rows())
    except OrchestratorError as error:
        said = str(error)
    assert "may be instantiated only once per process, but is twice: `simulate` and `ssp run` give each" in said
    assert simulate(path).steps == 20


def test_shared_input() -> None:
    assert simulate(shared_input("16-once-per-process/two.toml")).steps == 100
