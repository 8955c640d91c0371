"""Two results of one command: what differs beyond the intervals, and what does not."""

import json
from pathlib import Path

import pytest

from orchestrator.errors import InputError
from orchestrator.reporting import Plot, ReportTable, render
from orchestrator.workbench.compare import ResultNumber, compare_results, facts_of


def result(folder: Path, alpha: float, half: float, rate: float = 500.0, verdict: str = "effects") -> Path:
    """Write a result directory with a half-gap and its interval."""
    folder.mkdir()
    found = {
        "verdict": verdict,
        "effects": [{"name": "backlash", "parameters": {
            "alpha": {"value": alpha, "interval": [alpha - half, alpha + half], "unit": "rad"}}}],
        "parameters": {"J_m": {"value": 0.4, "interval": [0.39, 0.41], "unit": "kg.m2"}},
        "analysis": [{"source": "a.csv", "rate": rate}],
        "settings": {"band": {"most_rows": 1}},
    }  # fmt: skip
    document = {"command": "diagnose", "version": "1", "arguments": {"record": folder.name}, "results": found}
    (folder / "diagnose.json").write_text(json.dumps(document))
    (folder / "diagnose.csv").write_text("time,theta_m\n" + "\n".join(f"{n},{alpha * n}" for n in range(5)))
    return folder


def tables(report) -> dict[str, ReportTable]:
    return {section.title: section for section in report.sections if isinstance(section, ReportTable)}


def test_what_differs_beyond_the_intervals(tmp_path: Path) -> None:
    first, second = result(tmp_path / "diagnose-1", 0.01, 0.001), result(tmp_path / "diagnose-2", 0.02, 0.001)
    report = compare_results(first, second)
    found = tables(report)
    assert [row[0] for row in found["Differ by more than their intervals"].rows] == [
        "effects backlash parameters alpha"
    ]
    assert found["Differ by more than their intervals"].rows[0][3] == pytest.approx(2.0)
    assert [row[0] for row in found["Agree within their intervals"].rows] == ["parameters J_m"]
    assert report.badge == ("warn", "they differ")
    plot, difference = [section for section in report.sections if isinstance(section, Plot)]
    assert [series.name for series in plot.series] == ["diagnose-1", "diagnose-2"]
    assert list(difference.series[0].y) == pytest.approx([0.01 * n for n in range(5)])
    assert "diagnose-2" in render(report)


def test_angles_are_shown_in_the_unit_of_the_log(tmp_path: Path) -> None:
    first, second = result(tmp_path / "diagnose-1", 0.01, 0.001), result(tmp_path / "diagnose-2", 0.02, 0.001)
    path = first / "diagnose.json"
    document = json.loads(path.read_text())
    document["results"]["angle_unit"] = "deg"
    path.write_text(json.dumps(document))
    page = render(compare_results(first, second))
    assert 'data-angle="deg"' in page
    assert '<span data-unit="rad">0.02 rad (0.019 to 0.021)</span>' in page
    document["results"]["angle_unit"] = '"><script>'
    path.write_text(json.dumps(document))
    assert 'data-angle="rad"' in render(compare_results(first, second))


def test_values_within_their_intervals_do_not_differ(tmp_path: Path) -> None:
    first = result(tmp_path / "diagnose-1", 0.01, 0.001)
    second = result(tmp_path / "diagnose-2", 0.0115, 0.001, 250.0, "none")
    report = compare_results(first, second)
    found = tables(report)
    assert "Differ by more than their intervals" not in found
    assert [row[0] for row in found["Numbers without an interval that differ"].rows] == ["analysis a.csv rate"]
    assert ("verdict", "effects", "none") in found["Words that differ, and what one of the two alone says"].rows
    assert report.badge == ("warn", "their curves differ")
    (second / "diagnose.csv").write_text((first / "diagnose.csv").read_text())
    assert compare_results(first, second).badge == ("good", "no difference beyond the intervals")


def run(folder: Path, alpha: float, peak: float) -> Path:
    """Write the result of a simulation: no number of it has an interval."""
    folder.mkdir()
    signals = [{"signal": f"plant.{n}", "unit": "N.m", "first": 0.0, "last": peak * n, "rms": peak} for n in (1, 2)]
    document = {"command": "simulate", "arguments": {"alpha": alpha}, "results": {"signals": signals, "steps": 4}}
    (folder / "simulate.json").write_text(json.dumps(document))
    rows = "".join(f"{n},{peak * n},1.0\n" for n in range(5))
    (folder / "simulate.csv").write_text(f"time,plant.1,plant.2\n{rows}")
    return folder


def test_runs_are_compared_by_their_curves_and_never_green(tmp_path: Path) -> None:
    same = [run(tmp_path / f"simulate-{n}", 0.0, 28.0) for n in (1, 2)]
    report = compare_results(*same)
    assert report.badge == ("neutral", "nothing has an interval")
    assert "0 of 2 curves differ." in report.summary
    other = run(tmp_path / "simulate-3", 0.05, 145.0)
    report = compare_results(same[0], other)
    assert report.badge == ("warn", "their curves differ")
    assert report.summary.startswith("Changed: alpha 0.0 -> 0.05. 0 of 0 numbers with an interval")
    rms = 117.0 * (30.0 / 5.0) ** 0.5
    assert f"1 of 2 curves differ: plant.1 by {rms:.3g} (rms)." in report.summary
    rows = tables(report)["Numbers without an interval that differ"].rows
    assert ("signals plant.1 last", "28 N.m", "145 N.m") in [row[:3] for row in rows]
    plots = [section for section in report.sections if isinstance(section, Plot)]
    assert [plot.title for plot in plots] == [
        "simulate: plant.1", "simulate: plant.1, difference", "simulate: plant.2",
    ]  # fmt: skip
    assert list(plots[1].series[0].y) == [117.0 * n for n in range(5)]
    assert "simulate-3 minus simulate-1" in render(report)
    (other / "simulate.csv").write_text("time,plant.1,plant.2\n0,1,2\n7,1,2\n")
    assert (
        "2 of 2 curves differ: plant.1 (other rows), plant.2 (other rows)." in compare_results(same[0], other).summary
    )


def test_symbols_stay_whole_and_plain_numbers_have_no_unit(tmp_path: Path) -> None:
    first, second = result(tmp_path / "diagnose-1", 0.01, 0.001), result(tmp_path / "diagnose-2", 0.02, 0.001)
    agree = tables(compare_results(first, second))["Agree within their intervals"]
    assert [row[0] for row in agree.rows] == ["parameters J_m"]
    assert str(ResultNumber(3.984, (3.98, 3.99), "1")) == "3.984 (3.98 to 3.99)"
    assert str(ResultNumber(2.0, None, "rad")) == "2 rad"


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    one = result(tmp_path / "diagnose-1", 0.01, 0.001)
    (tmp_path / "check-1").mkdir()
    with pytest.raises(InputError, match="whole"):
        compare_results(one, tmp_path / "check-1")
    (tmp_path / "check-1" / "check.json").write_text('{"command": "check", "results": {}}')
    with pytest.raises(InputError, match="one command"):
        compare_results(one, tmp_path / "check-1")
    (tmp_path / "check-1" / "check.json").write_text("[")
    with pytest.raises(InputError, match="JSON"):
        compare_results(one, tmp_path / "check-1")


def test_numbers_take_their_intervals() -> None:
    found = dict(facts_of({"alpha": 1.0, "interval": [0.5, 2.0], "visible": True, "more": [1.0, {"x": None, "y": 3}]}))
    assert found == {
        "the half-gap": ResultNumber(1.0, (0.5, 2.0), "rad"), "visible": "True", "more 2 y": ResultNumber(3.0),
    }  # fmt: skip


def test_misfits_and_ranges_have_the_unit_beside_them_and_other_numbers_none() -> None:
    misfit = {"nominal": 0.2, "final": 0.01, "noise": 0.001, "unit": "rad"}
    channel = {"name": "u", "unit": "N.m", "least": -1.0, "most": 2.0, "missing": 3}
    found = dict(facts_of({"misfit": {"theta_m": misfit}, "channels": [channel], "final": 4.0}))
    assert {name: (one.value, one.unit) for name, one in found.items() if not isinstance(one, str)} == {
        "misfit theta_m nominal": (0.2, "rad"), "misfit theta_m final": (0.01, "rad"),
        "misfit theta_m noise": (0.001, "rad"), "channels u least": (-1.0, "N.m"), "channels u most": (2.0, "N.m"),
        "channels u missing": (3.0, ""), "final": (4.0, ""),
    }  # fmt: skip
