"""Sliders of a result: at home its curves are those of the result, and nothing goes out of its range."""

import json
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import InputError
from orchestrator.workbench import simulation
from orchestrator.workbench.simulation import SliderModel, SliderModels
from tests.support.workbench import HANGS

STEP, ROWS = 0.002, 400
STARTS = {"theta_m_start": 0.1, "omega_m_start": 0.0, "theta_l_start": 0.02, "omega_l_start": 0.0, "T_m_start": 0.0}
VALUES = {"alpha": 0.01, "J_m": 0.3, "effects.load_torque.torque": -2.0}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result whose measured angles are those that a scenario gives for the same FMU."""
    folder = tmp_path_factory.mktemp("results") / "diagnose-1"
    folder.mkdir()
    time = np.arange(ROWS) * STEP
    torque = np.round(40.0 * np.sin(7.0 * time), 6)
    (folder / "torque.csv").write_text(
        "time,u\n" + "\n".join(f"{t:.3f},{u!r}" for t, u in zip(time, torque.tolist(), strict=True))
    )
    given = ", ".join(f'"{name}" = {value}' for name, value in {**VALUES, **STARTS}.items())
    (folder / "loop.toml").write_text(f"""
stop = {(ROWS - 1) * STEP}
record = ["plant.theta_m", "plant.theta_l"]
[master]
algorithm = "gauss_seidel"
step = {STEP}
[instances.plant]
fmu = "Drivetrain"
parameters = {{ {given} }}
[[sources]]
to = "plant.u"
kind = "table"
file = "torque.csv"
column = "u"
hold = true
""")  # fmt: skip
    run = simulate(folder / "loop.toml")
    table = np.column_stack([time, torque, run["plant.theta_m"], run["plant.theta_l"]])
    np.savetxt(folder / "diagnose.csv", table, "%.17g", ",", header="time,u,theta_m,theta_l", comments="")
    live = {"fmu": "Drivetrain", "step": STEP, "values": VALUES, "rows": [0], "starts": [STARTS]}
    (folder / "diagnose.json").write_text(json.dumps({"command": "diagnose", "results": {"live": live}}))
    return folder


@pytest.fixture(scope="module")
def model(result: Path):
    found = SliderModel(result)
    yield found
    found.close()


def test_at_home_the_curves_are_those_of_the_result(model: SliderModel) -> None:
    seen = model.describe()
    assert len(seen["time"]) == ROWS
    for name, measured in seen["measured"].items():
        assert np.ptp(measured) > 1e-3
        np.testing.assert_allclose(model.run({})["curves"][name], measured, rtol=0.0, atol=1e-8)
    sliders = {one["name"]: one for one in seen["sliders"]}
    assert (sliders["alpha"]["value"], sliders["J_m"]["value"], sliders["J_l"]["value"]) == (0.01, 0.3, 5.6)
    assert all(one["low"] <= one["value"] <= one["high"] for one in sliders.values())


def test_a_slider_moves_the_curve_and_moves_it_back(model: SliderModel) -> None:
    home = model.run({})["curves"]["theta_m"]
    moved = model.run({"alpha": 0.03})["curves"]["theta_m"]
    assert np.max(np.abs(np.subtract(moved, home))) > 1e-3
    assert model.run({"alpha": 0.01})["curves"]["theta_m"] == home


@pytest.mark.parametrize(
    "values", [{"alpha": -1.0}, {"alpha": "0"}, {"k": True}, {"theta_m_start": 1.0}, {"x": 1.0}, {"k": 1e300}]
)
def test_values_out_of_range_are_refused(model: SliderModel, values: dict) -> None:
    with pytest.raises(InputError):
        model.run(values)


def test_results_without_a_model_are_refused(tmp_path: Path) -> None:
    for live in (
        None,
        {},
        {"fmu": "Nothing", "step": 0.1, "rows": [0], "starts": [{}]},
        {"fmu": "Drivetrain", "step": 0.0},
    ):
        folder = tmp_path / "estimate-1"
        folder.mkdir(exist_ok=True)
        (folder / "estimate.json").write_text(json.dumps({"results": {"live": live}}))
        with pytest.raises(InputError, match="no model"):
            SliderModel(folder)
    with pytest.raises(InputError, match="has none"):
        SliderModel(tmp_path / "check-1")


def test_only_the_latest_models_stay_open(result: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No model is closed while another thread runs it: the FMU's memory would be gone."""
    open_models, told, go_on = set(), Event(), Event()

    class Model:
        def __init__(self, folder: Path) -> None:
            open_models.add(self)

        def close(self) -> None:
            open_models.remove(self)

    monkeypatch.setattr(simulation, "SliderModel", Model)
    models = SliderModels(1)

    def run(model: Model) -> dict:
        told.set()
        assert go_on.wait(HANGS)
        return {"open": model in open_models}

    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(models.use, result, run)
        assert told.wait(HANGS)
        second = threads.submit(models.use, result.with_name("diagnose-2"), lambda model: {"all": len(open_models)})
        assert not wait([second], 0.2).done
        go_on.set()
        assert (first.result(), second.result()) == ({"open": True}, {"all": 1})
    models.close()
    assert not open_models
