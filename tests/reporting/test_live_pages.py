"""Live pages in a real browser: what a slider shows is what the FMU computes, at once, by keys, on any screen."""

import json
from dataclasses import replace

import numpy as np
import pytest

from orchestrator.api.pair import PairResult
from orchestrator.building.build import ensure_built
from orchestrator.building.compilers import find_compiler
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.paired import pair
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.live import regulator_design
from orchestrator.reporting import report_from_directory, write_report
from orchestrator.reporting.pages import live as live_pages
from pyfmu_sources.riccati import regulator_gains
from tests.support import browser as browsers

COMPILER = find_compiler()
WITH_ZIG = pytest.mark.skipif(COMPILER is None or not COMPILER.is_zig, reason="zig is not installed")
IN_A_BROWSER = pytest.mark.skipif(bool(browsers.missing()), reason=browsers.missing() or "never")
STEP, SECONDS = 0.005, 30.0
AGREE = 1e-12  # of a signal's range: the C libraries' sin and exp differ in the last bit
MODELS = {
    "Drivetrain": {
        "alpha": 0.02,
        "k": 2500.0,
        "effects.stribeck_friction.motor.coulomb": 0.5,
        "effects.stribeck_friction.motor.breakaway": 0.8,
        "effects.torque_ripple.amplitude": 0.3,
    },
    "ServoAxis": {"effects.coulomb_friction.motor.torque": 0.4},
}
MOVED = {
    "Drivetrain": {"half-gap": 0.035, "torque ripple amplitude": 0.1},
    "ServoAxis": {"coulomb friction motor torque": 0.7},
}


@pytest.fixture(scope="module")
def driver():
    with browsers.browser() as started:
        yield started


@pytest.fixture(scope="module")
def request_torque():
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    return 4.0 * np.sin(2.0 * time) * np.sin(0.31 * time)


def open_page(driver, folder):
    write_report(folder)
    browsers.set_screen(driver, 1280, 900, "light")
    driver.get_log("browser")
    browsers.open_page(driver, (folder / "report.html").as_uri())
    done = "const d = arguments[0], w = () => document.querySelector('.live').live.took ? d() : setTimeout(w, 10); w();"
    driver.execute_async_script(done)


def move(driver, changes):
    """Set controls by label; return the rows of the simulation and what the page says of it."""
    return driver.execute_async_script(
        """
        const [changes, done] = arguments, live = document.querySelector(".live").live;
        const values = live.data.controls.map((c) => changes[c.label] ?? c.value);
        if (Object.keys(changes).some((name) => !live.data.controls.some((c) => c.label === name))) return done(null);
        live.move(values);
        requestAnimationFrame(() => done([live.simulated.map((row) => [...row]), live.said.textContent]));
        """,
        changes,
    )


def plant_page(folder, fmu, u, starts):
    """A result directory of `estimate` with a record that is noise: only the simulation matters here."""
    folder.mkdir(exist_ok=True)
    rows = [0, round(10.0 / STEP)]
    live = {"fmu": fmu, "step": STEP, "values": MODELS[fmu], "rows": rows, "starts": starts}
    document = {"command": "estimate", "version": "0", "arguments": {}, "results": {"live": live}}
    (folder / "estimate.json").write_text(json.dumps(document))
    lines = [f"{STEP * n:.6g},{value!r},0.0" for n, value in enumerate(u.tolist())]
    (folder / "estimate.csv").write_text("\n".join(["time,u,theta_m", *lines]))
    return folder


def by_the_fmu(fmu, values, u, starts):
    """Return the motor's angle from the Python FMU, both runs one after the other."""
    instance = fmu_instance("plant", ensure_built([fmu])[fmu], values)
    parts = []
    for part, start in zip((u[:2000], u[2000:]), starts, strict=True):
        system = System((instance,), (), (SignalSource("plant.u", Samples(part, STEP)),))
        with Session(system, ("plant.theta_m",), GaussSeidel(STEP), (part.size - 1) * STEP) as session:
            parts.append(session.run({f"plant.{name}": value for name, value in start.items()})["plant.theta_m"])
    return np.concatenate(parts)


@WITH_ZIG
@IN_A_BROWSER
@pytest.mark.parametrize("fmu", MODELS)
def test_thirty_seconds_are_those_of_the_fmu(driver, tmp_path, fmu, request_torque):
    starts = [{"theta_m_start": 0.3, "omega_m_start": -1.0}, {"theta_m_start": -0.2, "omega_m_start": 2.0}]
    open_page(driver, plant_page(tmp_path / "page", fmu, request_torque, starts))
    names = {"half-gap": "alpha", "torque ripple amplitude": "effects.torque_ripple.amplitude"}
    names |= {"coulomb friction motor torque": "effects.coulomb_friction.motor.torque"}
    for changes in ({}, MOVED[fmu]):
        rows, _ = move(driver, changes)
        values = MODELS[fmu] | {names[label]: value for label, value in changes.items()}
        expected = by_the_fmu(fmu, values, request_torque, starts)
        assert np.ptp(expected) > 1.0
        assert np.max(np.abs(np.array(rows[0]) - expected)) <= AGREE * np.ptp(expected)
    assert driver.get_log("browser") == []


@pytest.fixture(scope="module")
def experiment():
    return replace(Experiment(), encoder_noise=1e-4)


@pytest.fixture(scope="module")
def pair_folder(tmp_path_factory, experiment, fmus):
    folder = tmp_path_factory.mktemp("pair")
    run = pair.run_pair(experiment, fmus, 0.02, seed=3)
    PairResult(0.02, experiment, run, 3).write(folder, folder)
    return folder


def gains_for(experiment, weights):
    design = regulator_design(experiment)
    scaled = [weight * design.sample_time for weight in weights]
    return regulator_gains(list(design.matrix), design.column, tuple(scaled[:5]), scaled[5])


@WITH_ZIG
@IN_A_BROWSER
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"half-gap": 0.0},
        {"half-gap": 0.07, "dry friction of the load": 10.0},
        {"weight of the motor speed": 80.0, "weight of the torque request": 5e-3},
    ],
    ids=["as it was", "no gap", "another gap and friction", "other weights"],
)
def test_the_pair_is_that_of_the_fmus(driver, pair_folder, experiment, fmus, changes):
    open_page(driver, pair_folder)
    rows, said = move(driver, changes)
    assert "2000 steps" in said
    weights = [*experiment.state_weights, experiment.torque_weight]
    start = {"plant.effects.coulomb_friction.load.torque": changes.get("dry friction of the load", 0.0)}
    if "weight of the motor speed" in changes:
        weights[1], weights[5] = changes["weight of the motor speed"], changes["weight of the torque request"]
        gains = gains_for(experiment, weights)
        start |= {f"{p}controller.K[{n}]": g for p in ("", "twin_") for n, g in enumerate(gains, start=1)}
    run = pair.run_pair(experiment, fmus, changes.get("half-gap", 0.02), seed=3, start=start)
    for loop, first in ((run.machine, 0), (run.twin, 6)):
        for n, name in enumerate(("theta_l_hat", "theta_m", "theta_l")):
            assert np.array_equal(rows[first + n], loop[name])  # no elementary function runs: not a bit differs
    assert driver.get_log("browser") == []


@WITH_ZIG
@IN_A_BROWSER
def test_a_slider_moves_by_keys_and_goes_back(driver, pair_folder):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    open_page(driver, pair_folder)
    half_gap = driver.find_element(By.CSS_SELECTOR, ".controls input")
    half_gap.send_keys(Keys.HOME)
    assert half_gap.get_attribute("aria-valuetext") == "0 rad"
    half_gap.send_keys(Keys.ARROW_RIGHT)
    assert half_gap.get_attribute("aria-valuetext") == "0.0001 rad"
    driver.find_element(By.CSS_SELECTOR, ".controls button").send_keys(Keys.ENTER)
    assert half_gap.get_attribute("aria-valuetext") == "0.02 rad"
    for width in (1280, 390, 320):
        browsers.set_screen(driver, width, 800, "dark")
        assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    messages = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    asked = [m["params"] for m in messages if m["method"] == "Network.requestWillBeSent"]
    urls = [a["request"]["url"] for a in asked if a["documentURL"].startswith("file:")]
    assert all(url.startswith(("data:", "file:")) for url in urls)


@WITH_ZIG
def test_a_page_is_at_most_one_and_a_half_megabytes(pair_folder):
    write_report(pair_folder)
    assert (pair_folder / "report.html").stat().st_size <= 1_500_000


def test_without_zig_a_page_says_what_is_missing(pair_folder, monkeypatch):
    monkeypatch.setattr(live_pages, "live_module", lambda *_, **__: None)
    sections = report_from_directory(pair_folder).sections
    assert [s.paragraphs for s in sections if s.title == live_pages.TITLE] == [(live_pages.NEEDS_ZIG,)]


def test_gains_are_those_of_the_design(experiment):
    rng = np.random.default_rng(4)
    for factors in [np.ones(6), *10.0 ** rng.uniform(-2.0, 2.0, (5, 6))]:
        weights = np.array([*experiment.state_weights, experiment.torque_weight]) * factors
        other = replace(experiment, state_weights=tuple(weights[:5]), torque_weight=float(weights[5]))
        np.testing.assert_allclose(gains_for(experiment, weights.tolist()), other.regulator().gains, rtol=1e-9)
