"""Model files: values and uncertainties that are read, mistakes that are named with their place."""

import re
from pathlib import Path

import pytest

from orchestrator.errors import ScenarioError
from orchestrator.plants.known import plants
from orchestrator.records.model_file import default_model, read_model

GOOD = """
fmu = "Drivetrain"
[parameters.J_l]
value = 5.0
relative_uncertainty = 0.1
[parameters.k]
uncertainty = 33.0
[encoders.theta_m]
counts_per_rev = 10000
noise = 3e-4
[columns.theta_l]
name = "q2"
unit = "deg"
"""


def _read(tmp_path: Path, text: str):
    path = tmp_path / "model.toml"
    path.write_text(text)
    return read_model(path)


def test_the_default_model_knows_linear_parameters_to_five_per_cent() -> None:
    model = default_model()
    assert {p.name for p in model.uncertain} == set(plants()["Drivetrain"].linear)
    for parameter in model.uncertain:
        assert parameter.uncertainty == pytest.approx(0.05 * parameter.value)
        assert parameter.standard_deviation == pytest.approx(parameter.uncertainty / 3.0**0.5)
    assert model.parameters["alpha"].value == 0.0
    assert read_model(None) == model


def test_a_model_file_is_read(tmp_path: Path) -> None:
    model = _read(tmp_path, GOOD)
    assert {p.name: round(p.uncertainty, 9) for p in model.uncertain} == {"J_l": 0.5, "k": 33.0}
    assert model.values[1] == 5.0
    assert model.encoder("theta_m").resolution == pytest.approx(6.283185e-4)
    assert model.encoder("theta_l").noise is None
    assert model.columns["theta_l"].name == "q2"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('fmu = "Gearbox"', "`fmu` in {} must be one of Drivetrain, ServoAxis, TwoStageTrain, but is 'Gearbox'"),
        ("fmu = 3", "`fmu` in {} must be text, but is a number"),
        ("fum = 3", "`fum` in {} must be fmu"),
        ("parameters = []", "`parameters` in {} must be a table, but is a list"),
        ("parameters.J_m = 3", "`parameters.J_m` in {} must be a table, but is a number: say `[parameters.J_m]` "),
        ("[parameters.J_q]\nvalue = 1", "`parameters.J_q` in {} must be a parameter of Drivetrain, but no such name"),
        ("[parameters.J_m]\nvalue = nan", "`parameters.J_m.value` in {} must be in [1e-09, 1e+12] kg.m2, but is nan"),
        ("[parameters.J_m]\nvalue = -1", "`parameters.J_m.value` in {} must be in"),
        ("[parameters.k]\nvalue = 0", "`parameters.k.value` in {} must be above 0 for the motor to drive the load"),
        (
            "fmu = 'TwoStageTrain'\n[parameters.k_2]\nvalue = 0.0",
            "`parameters.k_2.value` in {} must be above 0 for the motor",
        ),
        ("[parameters.J_m]\nvalue = '1'", "`parameters.J_m.value` in {} must be a number, but is text"),
        ("[parameters.J_m]\nvalue = true", "`parameters.J_m.value` in {} must be a number, but is true or false"),
        ("[parameters.J_m]\nvalue = 1979-05-27", "must be a number, but is a date or time"),
        ("[parameters.J_m]\nvalue = 1" + 400 * "0", "must be a number of at most 18 digits"),
        (
            "[parameters.J_m]\nuncertainty = -1",
            "`parameters.J_m.uncertainty` in {} must be a finite number that",
        ),
        ("[parameters.J_m]\nuncertainty = 1\nrelative_uncertainty = 1", "`parameters.J_m` in {} must have"),
        ("[parameters.J_m]\nvalu = 1", "`parameters.J_m.valu` in {} must be parameters.J_m.value"),
        ("[encoders.x]", "`encoders.x` in {} must be one of encoders.theta_m, encoders.theta_l"),
        ("[encoders.theta_m]\ncounts_per_rev = 0", "`encoders.theta_m.counts_per_rev` in {} must be at least 1"),
        ("[columns.theta_m]\nname = 3", "`columns.theta_m.name` in {} must be text, but is a number"),
        ('[columns.theta_m]\nunit = "lux"', "`columns.theta_m.unit` in {} must be one of rad, deg, rev, m"),
        ("a =", "{}: must be TOML, but is not: Invalid value"),
        ("a = " + 5000 * "[", "{}: must be TOML, but is nested too deeply"),
        (".".join(200 * ["a"]) + " = 1", "{}: must be TOML, but is nested too deeply"),
        ("[" + " . ".join(200 * ["'a'"]) + "]", "{}: must be TOML, but is nested too deeply"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        _read(tmp_path, text)
    assert expected.format(tmp_path / "model.toml") in str(caught.value)


@pytest.mark.parametrize("written", ["i = 20", "[parameters]\ni = 20"])
def test_the_lines_that_are_told_for_a_bare_number_are_read(tmp_path: Path, written: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        _read(tmp_path, written)
    section, line = re.findall("`([^`]*)`", str(caught.value))[-2:]
    assert _read(tmp_path, f"{section}\n{line}").parameters["i"].value == 20.0


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="cannot be read"):
        read_model(tmp_path / "absent.toml")


def test_a_file_of_an_editor_that_marks_its_encoding_is_read(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_bytes(b"\xef\xbb\xbf[parameters.J_m]\r\nvalue = 0.3\r\n")
    assert read_model(tmp_path / "model.toml").parameters["J_m"].value == 0.3
