"""A model file as fields, and fields as a model file: what is not changed stays as it is, to the bit."""

from pathlib import Path

import pytest

from orchestrator.records.model_file import read_model
from orchestrator.workbench.model_fields import model_fields, model_text

BASE = """\
fmu = "Drivetrain"
header = 3

[columns.u]
name = "Current [A]"
torque_constant = 0.72   # ASSUMED: put in the drive's

[encoders.theta_m]
counts_per_rev = 8192

[parameters.J_m]
value = 0.0123456789012345678   # kg.m2: inertia of the motor; ASSUMED: half of what is seen
relative_uncertainty = 0.3
assumed = true

[parameters.k]
value = 447.779   # N.m/rad: stiffness; ROUGH: a shaft that oscillates at 8.79 Hz

[parameters.i]
value = 12   # 1: gear ratio; from the record: slope
relative_uncertainty = 0

[parameters.alpha]
value = 0.006

[parameters."effects.coulomb_friction.motor.torque"]
value = 0.09
uncertainty = 0.001
"""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    path = tmp_path / "base.toml"
    path.write_text(BASE)
    return path


def again(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "again.toml"
    path.write_text(text)
    return path


def test_fields_say_where_values_are_from(base: Path) -> None:
    fields = {one["name"]: one for one in model_fields(base)["parameters"]}
    sources = {name: fields[name]["source"] for name in ("J_m", "k", "i", "alpha", "b_m", "restitution")}
    assert sources == {
        "J_m": "assumed", "k": "from the record", "i": "from the record", "alpha": "yours", "b_m": "assumed",
        "restitution": "the FMU's own",
    }  # fmt: skip
    assert fields["J_m"]["uncertainty"] == pytest.approx(0.3 * 0.0123456789012345678)


def test_what_is_not_changed_is_read_again_to_the_bit(base: Path, tmp_path: Path) -> None:
    before, after = read_model(base), read_model(again(tmp_path, model_text(base, {})))
    assert after.parameters == before.parameters
    assert (after.columns, after.encoders, after.header) == (before.columns, before.encoders, before.header)


def test_a_change_is_the_users_and_the_rest_keeps_its_words(base: Path, tmp_path: Path) -> None:
    path = again(
        tmp_path, model_text(base, {"parameters": {"k": {"value": 500.0}, "b_l": {"value": 0.2, "uncertainty": 0.1}}})
    )
    fields = {one["name"]: one for one in model_fields(path)["parameters"]}
    assert (fields["k"]["value"], fields["k"]["source"]) == (500.0, "yours")
    assert (fields["b_l"]["uncertainty"], fields["b_l"]["source"]) == (0.1, "yours")
    assert (fields["J_m"]["source"], fields["i"]["source"]) == ("assumed", "from the record")
