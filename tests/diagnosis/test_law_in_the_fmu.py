"""A learned law in the corrected FMU: what any FMI tool gets from it is what the diagnosis says of the law."""

import json
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest

from orchestrator.api.diagnose import diagnose
from orchestrator.api.law import asked_law
from orchestrator.cli import main
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.proof.exported import law_of, refusal
from orchestrator.diagnosis.proof.free_run import free_run
from orchestrator.diagnosis.proof.misfit import segments
from orchestrator.errors import ScenarioError
from orchestrator.plants.learned import (
    DRY,
    KNOTS,
    LATER,
    MOTOR_SPEED,
    SINCE,
    names,
    with_law,
)
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record
from tests.support.short_records import DRIVETRAIN

ON = "effects.learned_law.on"


def free_runs(fmu, found, exported, **given):
    """Return the rms by signal of FMPy's free runs over the held-out part, from the starts that the results name."""
    runs, encoders = found.runs, [one.signal for one in found.misfit]
    h = runs.time[1] - runs.time[0]
    ends = [*(run["row"] for run in exported["runs"][1:]), len(runs.time)]
    errors = []
    for run, end in zip(exported["runs"], ends, strict=True):
        rows = slice(run["row"], end)
        count = end - run["row"]
        u = np.array(list(zip(h * np.arange(count), runs.u[rows], strict=True)), dtype=[("time", float), ("u", float)])
        result = fmpy.simulate_fmu(
            str(fmu), stop_time=(count - 1) * h, step_size=h, output_interval=h, input=u, output=encoders,
            start_values={**run["starts"], **given}, fmi_type="CoSimulation",
        )  # fmt: skip
        errors.append(np.column_stack([result[name][:count] for name in encoders]) - runs.measured[rows])
    return dict(zip(encoders, np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0)), strict=True))


def predicted(found):
    """Return the rms by signal of the predictor's free runs with the law, side by side as the FMU's are."""
    found = found.diagnosis
    fitted, settings = found.learned.fitted, found.settings.proof
    signals = fitted.likelihood.signals
    _, states = fitted.likelihood.over(signals.size).innovations(fitted.p, fitted.q)
    errors = [
        free_run(fitted.likelihood.plant, fitted.p, states[part.start], signals, part, settings.free_run).rms ** 2
        for part in segments(found.workings.parts.held_out, signals, settings)
    ]
    encoders = [one.signal for one in found.misfit]
    return dict(zip(encoders, np.sqrt(np.mean(errors, axis=0)), strict=False))


@pytest.mark.slow
@pytest.mark.parametrize("effects", [{"kspeed": 0.15}, {"knock": 15.0}])
def test_any_tool_gets_the_misfit_that_is_stated(effects, tmp_path) -> None:
    """Of a law of the twist that grows with speed, and of one that comes by a clock."""
    columns, _ = make_record(effects, 51, 16.0, substeps=50)
    found = diagnose(record_from_columns(columns, "machine"), with_law=True)
    assert (found.verdict, found.with_law) == ("unknown", True)
    found.save(tmp_path)
    results = json.loads((tmp_path / "diagnose.json").read_text())["results"]
    law, exported = results["learned_law"], results["learned_law"]["exported"]
    assert exported["parameter"] == ON
    fmu = tmp_path / "Drivetrain_machine.fmu"
    on, off = (free_runs(fmu, found, exported, **{ON: switch}) for switch in (1, 0))
    for signal, stated in law["misfit"].items():
        assert on[signal] == pytest.approx(predicted(found)[signal], rel=0.02)
        assert on[signal] == pytest.approx(stated["after"], rel=0.1)  # which is the mean over more runs
        assert on[signal] == pytest.approx(exported["misfit"][signal], rel=1e-6)
        assert off[signal] > 5.0 * stated["after"]
    # The predictor's steps go across the knots of a knock, the FMU's end there.
    noise = results["misfit"]["theta_m"]["noise"]
    assert exported["largest_difference_from_predictor"] < 0.5 * noise
    written = np.genfromtxt(tmp_path / "diagnose.csv", delimiter=",", names=True)
    error = np.sqrt(np.mean((written["theta_m_with_law"] - written["theta_m"]) ** 2))
    assert error == pytest.approx(on["theta_m"], rel=1e-3)
    # Off, it is the corrected FMU as it is without the law.
    plain = diagnose_again(found)
    assert np.array_equal(found.runs.after, plain.runs.after)
    assert any(ON in line and "miss theta_m by" in line for line in found.summary())
    assert ON in (tmp_path / "report.html").read_text()


def diagnose_again(found):
    """Return the same result, had no law been asked for."""
    kept = {name: value for name, value in vars(found).items() if not name.startswith("_")}
    return type(found)(**{**kept, "with_law": False})


@pytest.mark.parametrize(
    ("verdict", "learned", "why"), [("effects", None, "is `effects`"), ("unknown", None, "none was")]
)
def test_where_no_law_can_be_a_note_says_why(verdict, learned, why) -> None:
    diagnosis = Diagnosis(
        **dict.fromkeys(Diagnosis.__dataclass_fields__, ())
        | {"verdict": verdict, "learned": learned, "warnings": ("one",)}
    )
    noted, has_law = asked_law(diagnosis)
    assert not has_law
    assert noted.warnings[0] == "one"
    assert why in noted.warnings[1]
    assert noted.warnings[1].startswith("the corrected FMU has no learned law")


def test_a_plant_whose_equations_take_no_law_is_named() -> None:
    workings = SimpleNamespace(plant=SimpleNamespace(name="LqrController"))
    diagnosis = SimpleNamespace(verdict="unknown", learned=object(), workings=workings)
    assert "the plant LqrController has no equations" in refusal(diagnosis)
    workings.plant.name = "ServoAxis"
    assert refusal(diagnosis) == ""


def test_a_law_brings_what_was_fitted_beside_it() -> None:
    """Parameters as changes, its friction apart, the distance over which that builds up among the changes."""
    wide = with_law(DRIVETRAIN, True)
    before = DRIVETRAIN.extended(default_model().values)
    p = np.concatenate([before, [entry.default for entry in wide.nuisances[len(DRIVETRAIN.nuisances) :]]])
    code, knots, values = names()
    p[wide.index(code)], p[wide.index(SINCE)], p[wide.index(DRY)] = LATER + MOTOR_SPEED, 3.0, 0.7
    p[[wide.index(name) for name in knots]] = np.arange(KNOTS)
    p[[wide.index(name) for name in values]] = 0.1 * np.arange(KNOTS)
    p[wide.index("J_l")] += 0.25
    p[wide.index("presliding.motor")] = np.log(3e-4)
    law = SimpleNamespace(
        argument="speed, from 3 s on", site="motor", fitted=SimpleNamespace(likelihood=SimpleNamespace(plant=wide), p=p)
    )
    found = law_of(DRIVETRAIN, law, before)
    assert (found["form"], found["since"], found["dry"]) == (LATER + MOTOR_SPEED, 3.0, 0.7)
    assert "period" not in found
    assert found["values"] == pytest.approx(0.1 * np.array(found["knots"]))
    assert set(found["changes"]) == {"J_l", "effects.presliding.motor.distance"}
    assert found["changes"]["J_l"] == pytest.approx(0.25)
    p[wide.index(code)] = 14  # of the twist, times speed: no friction, no clock
    found = law_of(DRIVETRAIN, law, before)
    assert not {"since", "period", "dry"} & set(found)
    assert found["value_unit"] == "N.m.s/rad"
    assert list(found["changes"]) == ["J_l"]


def test_a_law_is_not_asked_of_an_fmu_of_others(tmp_path, capsys) -> None:
    with pytest.raises(ScenarioError, match="`with_law` must be left out"):
        diagnose("a.csv", "b.fmu", "c.toml", with_law=True)
    assert main(["diagnose", "a.csv", "--fmu", "b.fmu", "--map", "c.toml", "--with-law"]) == 2
    assert "--with-law" in capsys.readouterr().err
