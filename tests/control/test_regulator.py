"""The command `regulator`: gains, margins, and what the loop does at rest."""

import json
import tomllib

import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.errors import ScenarioError


@pytest.fixture(scope="module")
def thesis():
    return oc.design_regulator()


def test_the_gains_are_those_of_the_fmus(thesis, tmp_path):
    default = oc.build(["LqrController"]).paths["LqrController"]
    assert thesis.forecast.cycles
    assert thesis.forecast.load == pytest.approx(2.26, abs=0.02)
    thesis.save(tmp_path / "out")
    parameters = tomllib.loads((tmp_path / "out" / "parameters.toml").read_text(encoding="utf-8"))
    stated = start_values(default)
    assert {name: pytest.approx(value, rel=1e-6) for name, value in parameters.items()} == {
        name: stated[name] for name in parameters
    }
    assert len(parameters) == 8


def start_values(fmu):
    import fmpy

    return {v.name: float(v.start) for v in fmpy.read_model_description(str(fmu)).modelVariables if v.start}


def test_the_model_file_and_the_delay_count(tmp_path, capsys):
    machine = tmp_path / "machine.toml"
    machine.write_text("[parameters.tau]\nvalue = 5e-3\n[parameters.alpha]\nvalue = 0.02\n", encoding="utf-8")
    words = [
        "regulator",
        "--model",
        str(machine),
        "--state-weights",
        "10,1,1000,500,0.01",
        "--out",
        str(tmp_path / "out"),
    ]
    results = []
    for delay in ("0", "3"):
        assert main([*words, "--delay", delay]) == 0
        document = json.loads((tmp_path / "out" / "regulator.json").read_text(encoding="utf-8"))
        results.append(document["results"]["forecast"])
        assert document["arguments"]["model"] == "machine.toml"
    assert "comes to rest" in capsys.readouterr().out
    assert not results[0]["cycles"]
    assert results[0]["delay_margin"] - results[1]["delay_margin"] == pytest.approx(3e-3, rel=1e-2)
    assert "comes to rest" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_own_gains_are_judged_as_those_of_the_design(thesis):
    judged = oc.design_regulator(gains=thesis.gains)
    assert judged.forecast == thesis.forecast
    with pytest.raises(ScenarioError, match="must be left out beside"):
        oc.design_regulator(gains=thesis.gains, state_weights=(1.0, 1.0, 1.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--gains", "1,2"], "--gains` must be 5 numbers"),
        (["--gains", "1,2,x,4,5"], "--gains` must be numbers separated by commas"),
        (["--gains", "-1,0,0,0,0"], "s: give other gains"),
        (["--gains", "0,10,0,10,0"], "its motion does not decay: give other gains"),
        (["--gains", "-.5e0,0,0,0,0"], "stable without a gap"),
        (
            ["--delay", "90"],
            "error: the loop must be stable without a gap, but with a `--delay` of 90 its motion doubles",
        ),
        (["--delay", "90"], "s: give a shorter `--delay` or other gains"),
        (["--state-weights", "0,1,0,1,1"], "--state-weights` must weigh an angle"),
        (["--state-weights", "-1,1,1,1,1"], "--state-weights` must be between 0 and"),
        (["--sample-time", "1"], "--sample-time` must be between"),
        (["--torque-weight", "0"], "--torque-weight` must be between"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path, capsys, words, told):
    assert main(["regulator", *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert told in error
    assert "\n" not in error
    assert not (tmp_path / "out").exists()
