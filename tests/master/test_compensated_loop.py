"""The compensated loop of docs/examples beside the same loop with the plain LQR, on native FMUs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.building.starts import default_starts
from orchestrator.scenarios.scenario import load_scenario, simulate
from pyfmu_sources.controllers.backlash_compensator_slave import BacklashCompensator
from tests.support.c_fmu import have_compiler
from tests.support.played_slave import play

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "soft_landing.toml"
NAMES = ["Drivetrain", "BacklashEstimator", "BacklashCompensator", "LqrController"]
SIDE_BY_SIDE = EXAMPLE.with_name("soft_step.toml")
SETTLED = 1000  # samples after which the estimator has seen the gap

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")


def run(folder, native, known=True):
    """The signals of the example; without a known half-gap the compensator is the plain LQR."""
    text = EXAMPLE.read_text(encoding="utf-8").replace('"plant.T_m"', '"plant.omega_m", "plant.omega_l"')
    for name in NAMES:
        text = text.replace(f'fmu = "{name}"', f'fmu = "{native[name]}"')
    if not known:
        text = text.replace('[[connections]]\nfrom = "estimator.alpha_hat"\nto = "compensator.alpha_hat"\n', "")
    path = folder / f"{known}.toml"
    path.write_text(text, encoding="utf-8")
    return simulate(load_scenario(path))


def impacts(result, begin=SETTLED):
    """Speeds of the twist in the last sample before the teeth meet [rad/s], from sample ``begin`` on."""
    contact = np.asarray(result["plant.contact"])
    speed = np.asarray(result["plant.omega_m"]) / 3.984 - np.asarray(result["plant.omega_l"])
    met = np.flatnonzero((contact[1:] != 0) & (contact[:-1] == 0))
    return np.abs(speed[met[met > begin]])


@pytest.fixture(scope="module")
def native(build_native):
    return build_native(NAMES)


def test_it_lands_softer_and_follows_closer_than_the_plain_lqr(tmp_path, native):
    soft, plain = run(tmp_path, native), run(tmp_path, native, known=False)
    time = np.asarray(soft.time)
    wanted = 0.25 - 0.25 * np.cos(np.pi * time)
    errors = [np.std((np.asarray(r["plant.theta_l"]) - wanted)[SETTLED:]) for r in (soft, plain)]
    assert impacts(plain).max() > 0.3
    assert impacts(soft).size > 2
    assert impacts(soft).max() < 0.6 * impacts(plain).max()
    assert errors[0] < 0.7 * errors[1]


def step_side_by_side(folder, native, delays):
    """The signals of the step of all FMUs side by side; ``delays`` of estimator and compensator in samples."""
    text = SIDE_BY_SIDE.read_text(encoding="utf-8")
    for name in NAMES:
        text = text.replace(f'fmu = "{name}"', f'fmu = "{native[name]}"')
    for before, after in zip(("delay = 1\n", "delay = 2\n"), delays, strict=True):
        assert before in text
        text = text.replace(before, f"delay = {after}\n")
    (folder / "step.toml").write_text(text, encoding="utf-8")
    return simulate(load_scenario(folder / "step.toml"))


def test_side_by_side_it_lands_softly_where_it_is_told_the_delay(tmp_path, native):
    told = step_side_by_side(tmp_path, native, (1, 2))
    found = impacts(told, begin=0)
    assert found.size > 8
    assert found.max() < 0.13  # the first landings included, whose half-gap is 20 % off
    theta_l = np.asarray(told["plant.theta_l"])
    assert abs(theta_l[-1] - 0.5) < 3e-3
    for delays in ((0, 0), (1, 0), (0, 1)):
        assert impacts(step_side_by_side(tmp_path, native, delays), begin=0).max() > 0.3


@pytest.mark.parametrize("delay", [0.0, 1.5])
def test_the_crossings_have_the_bits_of_python(tmp_path, native, delay):
    inputs = [v.name for v in BacklashCompensator.table if v.causality == "input"]
    outputs = ("u", "flank", "crossing")
    text = EXAMPLE.read_text(encoding="utf-8")
    for name in NAMES:
        text = text.replace(f'fmu = "{name}"', f'fmu = "{native[name]}"')
    text = text.replace(
        "[instances.compensator.parameters]\n", f"[instances.compensator.parameters]\ndelay = {delay}\n"
    )
    (tmp_path / "loop.toml").write_text(text, encoding="utf-8")
    loop = load_scenario(tmp_path / "loop.toml")
    result = simulate(replace(loop, record=tuple(f"compensator.{name}" for name in (*inputs, *outputs))))
    start = next(i.start for i in loop.system.instances if i.name == "compensator")
    start = default_starts("BacklashCompensator") | dict(start)
    given, expected = (np.array([result[f"compensator.{n}"] for n in names]).T for names in (inputs, outputs))
    assert np.sum(np.diff(expected[:, 2]) > 0.0) > 2
    assert np.array_equal(play(BacklashCompensator(), start, inputs, given, outputs, 1e-3), expected)
    other = start | {"K[2]": np.nextafter(start["K[2]"], 0.0)}  # the last bit of a parameter is seen
    assert not np.array_equal(play(BacklashCompensator(), other, inputs, given, outputs, 1e-3), expected)
