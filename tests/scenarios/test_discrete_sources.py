"""Sources that feed Integer, Boolean and Enumeration inputs over time."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import ConnectionMismatchError, ScenarioError
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.shared_inputs import shared_input

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
HEAD = (
    'stop = 1.0\nrecord = ["a.x", "a.mode", "a.on"]\n[master]\nstep = 0.1\nalgorithm = "{}"\n'
    '[instances.a]\nfmu = "Answers.fmu"\n[[sources]]\nto = "a.u"\nkind = "constant"\nvalue = 1.0\n'
)


def scenario(folder: Path, *sources: str, algorithm: str = "gauss_seidel") -> Path:
    """x' = 2 u (twice that while `on`) + mode, with u = 1."""
    build_answers_fmu(folder)
    (folder / "table.csv").write_text("time,n,b\n0,0,0\n0.3,2,1\n0.7,-1,0\n")
    path = folder / "run.toml"
    path.write_text(HEAD.format(algorithm) + "".join(f"[[sources]]\n{source}\n" for source in sources))
    return path


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi", "iterated"])
def test_tables_are_held(tmp_path: Path, algorithm: str) -> None:
    given = [f'to = "a.{name}"\nkind = "table"\nfile = "table.csv"\ncolumn = "{column}"'
             for name, column in (("mode", "n"), ("on", "b"))]  # fmt: skip
    result = simulate(scenario(tmp_path, *given, algorithm=algorithm))
    t = np.arange(10) * 0.1
    mode = np.where(t > 0.65, -1, np.where(t > 0.25, 2, 0))
    on = np.where((t > 0.25) & (t < 0.65), 1, 0)
    assert np.allclose(np.diff(result["a.x"]), 0.1 * (2.0 * (1 + on) + mode))
    assert list(result["a.mode"][1:]) == list(mode)


@pytest.mark.parametrize(
    ("source", "rate"),
    [
        ('to = "a.mode"\nkind = "constant"\nvalue = 3', 5.0),
        ('to = "a.on"\nkind = "constant"\nvalue = true', 4.0),
        ('to = "a.on"\nkind = "constant"\nvalue = 1', 4.0),
        ('to = "a.on"\nkind = "step"\nafter = true\ntime = -1', 4.0),
        ('to = "a.mode"\nkind = "square"\namplitude = 1\nperiod = 9\noffset = 1', 4.0),
    ],
)
def test_other_kinds(tmp_path: Path, source: str, rate: float) -> None:
    assert simulate(scenario(tmp_path, source))["a.x"][-1] == pytest.approx(rate)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ('to = "a.mode"\nkind = "constant"\nvalue = 2.5', "must be an integer of 32 bits, but is 2.5"),
        ('to = "a.on"\nkind = "constant"\nvalue = 2', "must be true or false (1 or 0) at all times, but is 2"),
        (
            'to = "a.mode"\nkind = "sine"\namplitude = 1\nfrequency = 1',
            "must be a constant, a step, a square or a table",
        ),
        ('to = "a.mode"\nkind = "table"\nfile = "table.csv"\ncolumn = "n"\nhold = false', "a table with hold = true"),
        ('to = "a.on"\nkind = "constant"\nvalue = "yes"', "must be a number, true or false, but is 'yes'"),
        ('to = "a.mode"\nkind = "constant"\nvalue = 1\nunit = "m"', "must be left out, but is given"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(tmp_path: Path, source: str, said: str) -> None:
    with pytest.raises(ScenarioError) as error:
        simulate(scenario(tmp_path, source))
    assert said in str(error.value)


def test_a_discrete_input_is_fed_once(tmp_path: Path) -> None:
    twice = ['to = "a.mode"\nkind = "constant"\nvalue = 1'] * 2
    with pytest.raises(ScenarioError, match=r"must be fed once, but .* is fed by something else too"):
        simulate(scenario(tmp_path, *twice))


def test_a_string_is_given_where_the_error_says(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    text = path.read_text()
    path.write_text(text + '[[sources]]\nto = "a.label"\nkind = "constant"\nvalue = "four"\n')
    with pytest.raises((ScenarioError, ConnectionMismatchError)):
        simulate(path)
    path.write_text(text.replace('fmu = "Answers.fmu"', 'fmu = "Answers.fmu"\nparameters = { label = "four" }'))
    assert simulate(path)["a.x"][-1] == pytest.approx(2.0 + 4)


@pytest.mark.parametrize(
    ("name", "last"), [("t11_integer", 10.0), ("t12_boolean", 1000.0), ("t14_integer_constant", 20.0)]
)
def test_shared_inputs(name: str, last: float) -> None:
    assert simulate(shared_input(f"09-tables-and-discrete/{name}.toml"))["s.y"][-1] == last
