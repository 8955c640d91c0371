"""From the results of `diagnose` and `estimate`, which start from a record, to their pages."""

import numpy as np
import pytest

from orchestrator.errors import ScenarioError
from orchestrator.reporting import Facts, Fold, Plot, ReportTable, Text, report_from_directory, write_report
from orchestrator.shared.output import write_result
from tests.support.page_results import INSPECT
from tests.support.reports import sections


def next_step(report):
    """Return the last line of what a page says is to be done."""
    (step,) = (text.paragraphs[-1] for text in sections(report, Text) if text.title == "What to do next")
    return step


def estimate(value):
    return {"value": value, "standard_error": 0.01 * value, "unit": "N.m"}


MISFIT = {"nominal": 0.1, "parameters": 0.05, "final": 0.001, "noise": 0.0009, "unit": "rad"}


def test_restarts_and_what_the_log_adds_have_their_places_on_the_page_of_a_diagnosis(tmp_path):
    late = {"name": "late_load", "grade": "certain", "parameters": {"shift": estimate(0.005) | {"unit": "s"}}}
    results = {
        "verdict": "parameters",
        "test": [{"source": "a.csv", "rows": 60, "misfit": {"theta_m": MISFIT}, "worse": False}],
        "nuisances": [late],
        "analysis": [{"source": "a.csv", "rate": 200.0, "rows": 400, "rows_of_the_file": 5, "band": {"motor": 12.0}}],
        "live": {"fmu": "Drivetrain", "step": 0.5, "values": {}, "rows": [0, 1], "starts": [{}, {}]},
        "settings": {"fit": {"blocks": 20}},
    }
    write_result(tmp_path, "diagnose", {}, None, results)
    (tmp_path / "diagnose.csv").write_text("time,theta_m,theta_m_after\n0,0,0\n0.5,1,1\n1,2,2\n")
    report = report_from_directory(tmp_path)
    tables = {table.title: table.rows for table in sections(report, ReportTable)}
    assert tables["What is missing"] == (("late load (in the log)", "certain", "shift 0.005 ± 5e-05 s", None),)
    assert tables["What was analysed"] == (("a.csv", 200.0, 400, 5, "motor 12"),)
    worth, difference, angle = sections(report, Plot)
    assert worth.title == "What the corrected model is worth on test data"
    assert not worth.note
    assert worth.spans == difference.spans
    assert [(span.start, span.end) for span in difference.spans] == [(0.0, 0.0), (0.5, 0.5)]
    assert angle.spans == difference.spans
    assert "Fit" not in [section.title for section in report.sections]


def test_the_page_of_a_diagnosis_names_effects_grades_and_what_is_left(tmp_path):
    effect = {
        "name": "coulomb_friction",
        "site": "motor",
        "grade": "likely",
        "parameters": {"torque": estimate(1.5) | {"interval": [1.4, 1.6]}},
        "explains": {"torque": 0.7, "motion": 0.9},
        "gain": 0.8,
        "t": 12.0,
        "family": ["stribeck_friction@motor"],
        "lowered_by": ["explained"],
        "block_values": {"torque": [1.4, 1.6, None, 1.5], "phase": [0.1, 0.2]},
        "missing_torque": {
            "x_label": "motor speed [rad/s]", "y_label": "torque at the motor [N.m]", "x": [-1.0, None, 1.0],
            "missing": [-1.5, None, 1.6], "law": [-1.4, None, 1.4], "spread": [0.1, None, 0.2],
        },
    }  # fmt: skip
    hint = (
        effect
        | {"missing_torque": None, "block_values": {}}
        | {"name": "load_torque", "site": "load", "grade": "possible", "family": [], "lowered_by": ["size"]}
    )
    test = {
        "source": "record.csv", "rows": 300, "misfit": {"theta_m": MISFIT}, "worse": True,
        "r_squared": {"theta_m": 0.99},
        "torque_left": {"nominal": 0.2, "parameters": 0.1, "final": 0.04},
    }  # fmt: skip
    results = {
        "verdict": "effects",
        "summary": ["Effects are missing. The model lacks Coulomb friction at the motor (likely).", "Next: log more."],
        "effects": [effect, hint],
        "parameters": {"J_m": {"nominal": 0.4, "value": 0.42, "standard_error": 0.001, "unit": "kg.m2"}},
        "test": [test],
        "validation": test | {"source": "other.csv", "worse": False},
        "model": "Corrected.fmu",
        "notes": ["the record is short"],
        "remaining": {
            "torque": {"motor": 0.029},
            "follows": [{"site": "motor", "argument": "position", "share": 0.33, "gain": 0.3, "t": 4.0, "formula": ""}],
        },
        "candidates": [
            {"on_top_of": [], "taken": "", "tried": [{"effect": "input_delay@actuator", "gain": 0.0, "t": 0.1}]}
        ],
    }
    write_result(tmp_path, "diagnose", {"data": "record.csv"}, None, results)
    (tmp_path / "diagnose.csv").write_text("time,theta_m,theta_m_before,theta_m_after\n0,0,0,0\n1,1,1.1,1.001\n")
    report = report_from_directory(tmp_path)
    assert "The model lacks Coulomb friction at the motor (likely)." in report.summary
    assert "load torque" not in report.summary
    tables = {t.title: t for t in sections(report, ReportTable)}
    lacking = tables["What is missing"].rows
    told = ("torque 1.5 N.m (95 %: 1.4 to 1.6)", "Stribeck friction at the motor")
    assert lacking[0] == ("Coulomb friction at the motor", "likely", *told)
    assert lacking[1][1] == "possible"
    why = tables["How sure"].rows[0]
    assert why[2:6] == (pytest.approx(80.0), 12.0, pytest.approx(70.0), pytest.approx(90.0))
    assert why[6:] == ("yes", "explained")
    assert "does worse" in tables["Misfit on test data of record.csv"].note
    assert "does worse" not in tables["Misfit on the other record, other.csv"].note
    assert tables["Misfit on test data of record.csv"].rows[0][-1] == 0.99
    assert tables["Torque that is left"].rows[0] == ("record.csv", 20.0, 10.0, 4.0)
    assert tables["What the rest follows"].rows[0][:3] == ("motor", "position", pytest.approx(33.0))
    assert tables["Parameters"].rows[0][-1] == pytest.approx(5.0)
    assert tables["What was tried"].rows[0][2] == "input delay in the drive"
    plots = {p.title: p for p in sections(report, Plot)}
    worth = plots["What the corrected model is worth on test data"]
    assert worth.y_label == "error of the motor angle [rad]"
    assert [(s.name, s.y.tolist()) for s in worth.series] == [
        ("model as given", [0.0, pytest.approx(0.1)]), ("corrected model", [0.0, pytest.approx(0.001)]),
    ]  # fmt: skip
    said = tables["What is missing"].note
    assert said.startswith("The rms misfit of the motor angle goes from 0.1 to 0.001 rad, 100 times less; the noise")
    assert not worth.note
    assert said.endswith("The corrected model does worse than re-fitted parameters.")
    first = [section.title for section in report.sections if not isinstance(section, Fold)]
    assert first == ["What is missing", worth.title, "What to do next"]
    assert "for any FMI 2.0 tool" in next_step(report)
    write_result(tmp_path, "diagnose", {}, None, results | {"trust": {"level": "red", "reasons": ["it is worse"]}})
    assert next_step(report_from_directory(tmp_path)) == ("The corrected model, Corrected.fmu, must not be used.")
    missing, law = plots["Missing torque: Coulomb friction at the motor"].series
    assert (missing.kind, law.kind) == ("points", "line")
    np.testing.assert_allclose(missing.low, [-1.6, np.nan, 1.4])
    np.testing.assert_allclose(missing.high, [-1.4, np.nan, 1.8])
    assert plots["Missing torque: Coulomb friction at the motor"].x_label == "motor speed [rad/s]"
    assert "Missing torque" in write_report(tmp_path).read_text()
    assert [s.name for s in plots["Motor angle"].series] == ["measured", "model as given", "corrected model"]
    before, after = plots["Motor angle: simulated minus measured"].series
    assert list(before.y) == [0.0, pytest.approx(0.1)]
    assert list(after.y) == [0.0, pytest.approx(0.001)]
    assert ("corrected model", "Corrected.fmu") in report.origin


@pytest.mark.parametrize("verdict", ["none", "parameters", "unknown"])
def test_a_diagnosis_without_effects_is_a_page_too(tmp_path, verdict):
    results = {"verdict": verdict, "summary": ["A. Said."], "effects": [], "parameters": {}, "test": [], "model": None}
    write_result(tmp_path, "diagnose", {}, None, results)
    assert report_from_directory(tmp_path).summary


def half_gap(alpha, **more):
    entry = {"alpha": alpha, "standard_error": 1e-5, "cramer_rao": 9e-6, "interval": [0.9 * alpha, 1.1 * alpha]}
    return (
        entry | {"level": 0.95, "unit": "rad", "visible": True, "message": "", "diagnostics": {"traversals": 9}} | more
    )


def test_the_page_of_an_estimate_compares_methods_and_shows_the_fit(tmp_path):
    parameters = {"k": {"value": 3310.0, "standard_error": 2.0, "nominal": 3300.0}}
    best = half_gap(0.002, diagnostics={"parameters": parameters, "profile_limit": 6.5})
    estimates = {"maximum_likelihood": best, "ekf": half_gap(0.0021), "torque_pulse": {"not_applicable": "no pulses"}}
    record = {"rows": 4, "step": 0.01, "source": "r.csv"}
    design = [{"name": "pulses", "bound": 1e-6, "peak_torque": 10.0, "peak_motor_speed": 2.0}]
    results = {"record": record, "estimates": estimates, "method": "maximum_likelihood", "design": design} | best
    write_result(tmp_path, "estimate", {}, None, results)
    (tmp_path / "profile.csv").write_text("alpha,drop\n0.0019,4\n0.00195,1\n0.002,0\n0.00205,1\n0.0021,4\n")
    (tmp_path / "online.csv").write_text("time,alpha,low,high\n0,0.1,0,0.3\n1,0.002,0.0019,0.0021\n")
    (tmp_path / "estimate.csv").write_text(
        "time,u,theta_m,theta_m_fitted,contact,one_step_error_m\n0,0,0,0,1,0\n1,1,1,1.5,0,1e-4\n2,1,2,2,-1,0\n"
    )
    (tmp_path / "design.csv").write_text("time,u\n0,1\n1,-1\n")
    report = report_from_directory(tmp_path)
    assert report.badge == ("good", "the gap is seen")
    assert "The half-gap is 0.002 rad, with 95 % confidence between 0.0018 and 0.0022 rad" in report.summary
    plots = {p.title: p for p in sections(report, Plot)}
    (estimates,) = (table for table in sections(report, ReportTable) if table.title == "Estimates")
    assert [row[1] for row in estimates.rows] == [0.002, 0.0021]
    profile = plots["Profile likelihood"].series[0]
    assert len(profile.x) > 100
    assert plots["Profile likelihood"].series[2].y == [6.5, 6.5]
    assert profile.y == pytest.approx([((x - 0.002) / 5e-5) ** 2 for x in profile.x], abs=1e-9)
    assert plots["Motor angle"].spans[0].start == 1.0
    assert plots["Motor angle: simulated minus measured"].series[0].y.tolist() == [0.0, 0.5, 0.0]
    assert plots["One-step errors"].series[0].y.tolist() == [0.0, 1e-4, 0.0]
    assert plots["The best excitation"].series[0].kind == "steps"
    tables = {t.title: t for t in sections(report, ReportTable)}
    assert [row[0] for row in tables["Estimates"].rows] == ["maximum likelihood", "ekf"]
    remarks = next(t for t in sections(report, Text) if t.title == "Remarks")
    assert "Torque pulse does not apply: no pulses." in remarks.paragraphs
    assert tables["Parameters fitted with the gap"].rows[0] == ("k", 3300.0, 3310.0, 2.0)


def test_an_estimate_that_no_method_gives_says_so(tmp_path):
    write_result(tmp_path, "estimate", {}, None, {"estimates": {"torque_pulse": {"not_applicable": "no pulses"}}})
    report = report_from_directory(tmp_path)
    assert report.badge == ("bad", "no estimate")


def test_a_record_that_bounds_the_gap_on_one_side_only_is_a_page(tmp_path):
    entry = half_gap(0.0, interval=[0.0, None], visible=False, message="the gap cannot be seen")
    method = "maximum_likelihood"
    write_result(tmp_path, "estimate", {}, None, {"method": method, "estimates": {method: entry}} | entry)
    report = report_from_directory(tmp_path)
    assert report.summary.startswith("No gap is seen: it is with 95 % confidence between 0 and any size rad.")
    assert report.badge == ("neutral", "no gap is seen")


def test_the_page_of_a_calibration_says_whether_the_parameters_suffice(tmp_path):
    value = {"value": 1.05, "standard_error": 0.01, "interval": [1.03, 1.07], "unit": "kg.m2", "nominal": 1.0}
    misfit = {"nominal": 40.0, "parameters": 5.0, "final": 5.0, "noise": 1e-4, "unit": "rad"}
    results = {
        "explained": False,
        "parameters": {"J": value | {"learned": 0.8}},
        "not_told_apart": [],
        "test": [{"source": "a.csv", "rows": 150, "worse": False, "misfit": {"theta": misfit}}],
        "notes": ["something else is missing"],
        "seconds": 1.0,
    }
    for explained, badge in ((True, "good"), (False, "bad")):
        write_result(tmp_path, "calibrate", {}, None, results | {"explained": explained})
        report = report_from_directory(tmp_path)
        assert report.badge[0] == badge
    write_result(tmp_path, "calibrate", {}, None, results | {"trust": {"level": "amber", "reasons": ["why"]}})
    assert report_from_directory(tmp_path).badge == ("warn", "amber: the parameters do not explain the record")
    rows = {t.title: t.rows for t in sections(report, ReportTable)}
    assert rows["Parameters"] == (("J", 1.0, 1.05, 0.01, 1.03, 1.07, "kg.m2", 80.0),)
    assert rows["Misfit on test data of a.csv"] == (("theta", 40.0, 5.0, 5.0, 1e-4, "rad"),)


def test_the_page_of_an_ssp_file_says_what_ran(tmp_path):
    signal = {"signal": "motor.speed", "unit": "rad/s", "first": "0", "last": "1", "smallest": "0", "largest": "1"}
    results = {"schema_version": 1, "signals": [signal], "steps": 2, "events": {}}
    (tmp_path / "ssp.csv").write_text("time,motor.speed\n0,0\n0.5,0.5\n1,1\n")
    write_result(tmp_path, "ssp", {"action": "run", "file": "some/where/drive.ssp"}, None, results)
    report = report_from_directory(tmp_path)
    assert report.title == "SSP file drive.ssp"
    assert report.summary.startswith(
        "The system in drive.ssp was run from 0 to 1 s in steps of 0.5 s, with signals of motor."
    )


def test_the_page_of_a_diagnosis_of_an_fmu_says_what_is_left_and_what_was_delivered(tmp_path):
    level = {"value": 0.8, "standard_error": 1e-4, "interval": [0.79, 0.81], "unit": "N.m"}
    friction = {
        "name": "coulomb_friction",
        "site": "axis",
        "grade": "certain",
        "parameters": {"level": level},
        "explains": {"theta_m": 0.99},
        "gain": 2.0,
        "t": 30.0,
        "family": [],
    }
    part = {"name": "coulomb_friction_1", "effect": "coulomb_friction@axis", "values": {"q0": 0.8}}
    results = {
        "kind": "fmu",
        "verdict": "effects",
        "trust": {"level": "amber", "reasons": ["more than measurement noise is left"]},
        "summary": [
            "Record a.csv, 400 rows. The log has coulomb friction at the axis.",
            "What is left follows nothing.",
        ],
        "effects": [friction],
        "notes": ["the record is short"],
        "remaining": {"outputs": {"theta_m": 0.01}, "follows": []},
        "delivery": [{"file": "corrected.ssp", "parts": [part], "difference_over_noise": 0.5, "note": ""}],
        "runs": 1994,
        "test": [{"source": "a.csv", "rows": 2, "misfit": {"theta_m": MISFIT}, "worse": False}],
        "test_start": 2.0,
    }
    write_result(tmp_path, "diagnose", {}, None, results)
    head = "time,u,theta_m,theta_m_nominal,theta_m_refitted,theta_m_corrected\n"
    (tmp_path / "diagnose.csv").write_text(f"{head}0,1,0,0,0,0\n1,1,1,1.5,1.2,1\n2,1,2,3,nan,2\n3,1,3,4,nan,3\n")
    report = report_from_directory(tmp_path)
    assert report.summary == "The log has coulomb friction at the axis."
    assert report.badge == ("warn", "amber: effects are missing")
    texts = {text.title: text.paragraphs for text in sections(report, Text)}
    worth, difference, output = sections(report, Plot)
    np.testing.assert_array_equal(worth.series[0].x, [2.0, 3.0])
    assert [(s.name, s.y.tolist()) for s in worth.series] == [
        ("model as given", [1.0, 1.0]), ("corrected model", [0.0, 0.0]),
    ]  # fmt: skip
    assert (difference.title, output.title) == ("theta_m: simulated minus measured", "theta_m")
    assert [s.name for s in output.series] == [
        "measured", "model as given", "with re-fitted parameters", "corrected model",
    ]  # fmt: skip
    np.testing.assert_allclose(difference.series[1].y, [0.0, 0.2, np.nan, np.nan])
    assert [(s.start, s.end, s.name) for s in output.spans] == [(2.0, 3.0, "test data")]
    assert texts["In words"] == ("What is left follows nothing.",)
    assert texts["Notes"] == ("the record is short",)
    (left,) = sections(report, Facts)
    assert left.items == (("share of the power of theta_m [%]", 1.0),)
    tables = {table.title: table.rows for table in sections(report, ReportTable)}
    assert tables["What is missing"] == (
        ("Coulomb friction at axis", "certain", "level 0.8 N.m (95 %: 0.79 to 0.81)", "none"),
    )
    assert tables["Corrected system"][0][:3] == ("corrected.ssp", "coulomb_friction@axis", 0.5)
    assert ("runs of the FMU", 1994) in report.origin


def test_the_page_of_an_inspection_plots_the_whole_record_in_the_log_s_unit(tmp_path):
    write_result(tmp_path, "inspect", {}, None, INSPECT | {"record": INSPECT["record"] | {"angle_unit": "deg"}})
    time = 0.01 * np.arange(5000)
    theta_m = np.sin(time)
    theta_m[7] = np.nan
    np.savez(tmp_path / "inspect_record.npz", time=time, theta_m=theta_m, u=np.cos(time))
    report = report_from_directory(tmp_path)
    plots = {plot.title: plot for plot in sections(report, Plot)}
    assert list(plots) == ["Motor angle", "Requested torque"]
    np.testing.assert_array_equal(plots["Motor angle"].series[0].y, theta_m)
    assert plots["Requested torque"].series[0].kind == "steps"
    assert report.angle_unit == "deg"


def test_a_damaged_record_beside_a_result_is_one_clear_error(tmp_path):
    write_result(tmp_path, "inspect", {}, None, INSPECT)
    (tmp_path / "inspect_record.npz").write_bytes(b"PK no archive")
    with pytest.raises(ScenarioError, match=r"inspect_record\.npz must be a NumPy file with numbers"):
        report_from_directory(tmp_path)
