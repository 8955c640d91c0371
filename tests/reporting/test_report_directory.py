"""From a result directory to its page: every command, damaged input, the `report` command."""

import json
import os
from dataclasses import asdict, dataclass

import msgspec
import pytest

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.findings import Execution
from orchestrator.checking.findings import Finding as CheckFinding
from orchestrator.checking.findings import FmuFindings as CheckReport
from orchestrator.checking.formats.text import as_results
from orchestrator.checking.policy import Policy
from orchestrator.checking.verdict import judge
from orchestrator.cli import main
from orchestrator.errors import OutputError, ScenarioError
from orchestrator.paired.metric import ErrorStatistics
from orchestrator.paired.sweep import COLUMNS
from orchestrator.reporting import Findings, Plot, ReportTable, report_from_directory, write_report
from orchestrator.reporting.directory import COMMANDS
from orchestrator.shared.output import write_result
from tests.support.reports import sections

SWEEP = """case,noise,repetition,alpha,status,S,estimate,lower,upper,error,error_percent,message
0,0.0,1.0,0.002,done,0.1,0.0021,0.0019,0.0022,1e-4,5.0,
1,0.0,1.0,0.05,done,1.5,0.0499,0.049,0.051,1e-4,0.2,
2,0.0001,1.0,0.002,done,0.1,0.0019,0.0018,0.0023,1e-4,5.0,
3,0.0001,1.0,0.05,crash,,,,,,,the worker process died
"""

REGULATOR = """{"gains": {"K[1]": 1, "K[2]": 1, "K[3]": 1, "K[4]": 1, "K[5]": 1}, "sample_time": 0.001, "delay": 0,
"forecast": {"cycles": false, "twist": 1.89, "load": 2.26, "frequency": 1.84, "phase_margin": 1.1, "rank": 5,
"delay_margin": 0.0324, "upper_gain": 86.2}, "frequencies": [1, 2, 3], "response": [10, 1, 0.1], "phases": [0, 0, 0]}"""


@pytest.fixture
def sweep(tmp_path):
    statistics = [{"noise": n} | asdict(ErrorStatistics(2, 2.5, 5.0, 1e-8, 1.0)) for n in (0.0, 1e-4)]
    results = {
        "cases": 4,
        "failed": 1,
        "statistics": statistics,
        "columns": [{"name": c.name, "unit": c.unit} for c in COLUMNS],
        "experiment": {"name": "default", "duration": 2.0, "values": {"k": 3300.0}},
        "calibrations": {"0": {"digest": "abc", "runs": 10}, "0.0001": {"digest": "def", "runs": 10}},
        "fmus": {"Drivetrain": "0123"},
    }
    write_result(tmp_path, "sweep", {"sizes": "0.002,0.05", "resume": False}, 7, results)
    (tmp_path / "sweep.csv").write_text(SWEEP)
    return tmp_path


def test_the_page_of_a_sweep_shows_statistics_estimates_and_failures(sweep):
    report = report_from_directory(sweep)
    assert report.badge == ("bad", "1 of 4 cases failed")
    assert "Without noise the error is 2.5 % in the mean and 5 % at worst" in report.summary
    estimates, _errors = sections(report, Plot)
    quiet, noisy = estimates.series
    assert (quiet.name, noisy.name) == ("no noise", "noise 0.0001 rad")
    assert (quiet.x, quiet.y, quiet.low) == ([0.002, 0.05], [0.0021, 0.0499], [0.0019, 0.049])
    assert noisy.x == [0.002]
    assert estimates.log_x
    tables = {t.title: t for t in sections(report, ReportTable)}
    assert [row[-1] for row in tables["Failed cases"].rows] == ["the worker process died"]
    assert len(tables["Cases"].rows) == 4
    assert ("seed", 7) in report.origin
    assert ("resume", False) not in report.origin
    assert [p.name for p in report.downloads] == ["sweep.csv", "sweep.json"]


def test_a_title_names_files_the_day_and_who_made_it_and_no_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("BACKLASH_COSIM_AUTHOR", "A. Engineer <b>, Drives Ltd")
    files = {"record": "/home/me/axis.csv", "records": ["/home/me/axis.csv"], "model": r"C:\work\axis7.toml"}
    asked = files | {"vary": ["k=1/2.5"], "columns": "N.m/rad", "rate": 100.0}
    write_result(tmp_path, "regulator", asked, None, json.loads(REGULATOR))
    os.utime(tmp_path / "regulator.json", (1_000_036_800.0, 1_000_036_800.0))
    report = report_from_directory(tmp_path)
    assert report.about == ("axis.csv", "axis7.toml", "2001-09-09", "by A. Engineer <b>, Drives Ltd")
    assert {"record": "axis.csv", "vary": "k=1/2.5", "columns": "N.m/rad"}.items() <= dict(report.origin).items()
    page = write_report(tmp_path).read_text().split("<footer>")[0]
    assert "axis.csv, axis7.toml, 2001-09-09, by A. Engineer &lt;b&gt;, Drives Ltd</title>" in page
    assert "/home/me" not in page


@pytest.mark.parametrize(
    ("changes", "badge", "said"),
    [
        ({}, ("good", "it comes to rest"), "the loop comes to rest"),
        (
            {"cycles": True},
            ("warn", "limit cycle at 1.84 Hz"),
            "has a limit cycle at 1.84 Hz, with an amplitude of 2.26 half-gaps",
        ),
        ({"upper_gain": 1.9}, ("bad", "small margins"), "comes to rest"),
        ({"lower_gain": 0.6}, ("bad", "small margins"), "comes to rest"),
        ({"phase_margin": 0.5}, ("bad", "small margins"), "comes to rest"),
    ],
)
def test_the_page_of_a_regulator_judges_its_margins(tmp_path, changes, badge, said):
    results = json.loads(REGULATOR)
    results["forecast"] |= changes
    write_result(tmp_path, "regulator", {}, None, results)
    report = report_from_directory(tmp_path)
    assert (report.badge, report.angle_unit) == (badge, "deg")
    assert said in report.summary
    (gain, phase) = sections(report, Plot)
    assert (gain.y_label, phase.y_label) == ("gain [dB]", "phase [rad]")
    assert gain.series[0].y == [20.0, 0.0, -20.0]


@pytest.mark.parametrize(
    ("changes", "badge"),
    [
        ({}, ("good", "take the compensator")),
        ({"compensator": {"unstable": 1}}, ("warn", "take the LQR")),
        ({"shifted": {"impact": 0.14}}, ("good", "take the shifted")),
        ({key: {"unstable": 2} for key in ("LQR", "shifted", "compensator")}, ("bad", "none is stable")),
    ],
)
def test_the_page_of_laws_recommends_what_is_stable_soft_and_accurate(tmp_path, changes, badge):
    numbers = {"LQR": (0.19, 0.12), "shifted": (0.55, 0.0017), "compensator": (0.12, 0.0027)}
    more = {"rest": None, "contacts": None, "unstable": 0}
    laws = [{"law": n, "impact": i, "error": e} | more | changes.get(n, {}) for n, (i, e) in numbers.items()]
    results = {"alpha": 0.02, "tau": 0.005, "impact_speed": 0.1, "bound": 0.036, "laws": laws}
    write_result(tmp_path, "compensate", {}, None, results)
    assert report_from_directory(tmp_path).badge == badge


def test_the_page_of_a_check_lists_what_was_found(tmp_path):
    rule = next(name for name, rule in RULES.items() if rule.severity == "error")
    found = CheckReport("a/bad.fmu", (CheckFinding(rule, "modelDescription.xml", "A unit must be defined."),))
    good = CheckReport(
        "good.fmu", (), "2.0", executions=(Execution("CoSimulation", {"load": ""}),), facts={"version": "2.0"}
    )
    write_result(tmp_path, "check", {}, None, as_results([judge(report, Policy()) for report in (found, good)]))
    report = report_from_directory(tmp_path)
    assert report.badge == ("bad", "1 failed")
    assert report.summary.startswith("1 of 2 FMUs pass.")
    (findings,) = sections(report, Findings)
    assert (findings.title, findings.items[0].text) == ("bad.fmu", "A unit must be defined.")
    table, facts, unrun = sections(report, ReportTable)
    assert [row[0] for row in table.rows] == ["bad.fmu", "good.fmu"]
    assert facts.rows == (("bad.fmu", None), ("good.fmu", "2.0"))
    assert [row[2] for row in unrun.rows if row[0] == rule] == ["good.fmu"]


def test_the_page_of_a_check_puts_findings_of_one_rule_together(tmp_path):
    first, second = (name for name, rule in list(RULES.items())[:2] if rule.severity == "error")
    found = [CheckFinding(rule, f"place {n}", f"what {n}") for n, rule in enumerate((first, second, first, first))]
    write_result(tmp_path, "check", {}, None, as_results([judge(CheckReport("bad.fmu", tuple(found)), Policy())]))
    (findings,) = sections(report_from_directory(tmp_path), Findings)
    assert [(f.text, f.more) for f in findings.items] == [
        ("what 0", ("place 2: what 2", "place 3: what 3")),
        ("what 1", ()),
    ]
    assert "and 2 more like this" in write_report(tmp_path).read_text()


def test_the_page_of_a_pair_shades_the_time_out_of_contact(tmp_path):
    results = {"alpha": 0.02, "S": 1.0, "estimate": None, "no_estimate": "S is too large", "crossings": 1}
    write_result(tmp_path, "simulate", {"alpha": 0.02}, 0, results)
    (tmp_path / "simulate.csv").write_text(
        "time,reference,theta_l_hat,theta_l,contact,twin_theta_l_hat,twin_theta_l\n"
        "0,0,0,0,1,0,0\n1,0,1,0,0,0.5,0\n2,0,2,0,0,0.5,0\n3,0,3,0,-1,0.5,0\n4,0,3,0,0,0.5,0\n"
    )
    report = report_from_directory(tmp_path)
    assert "S is too large" in report.summary
    position, difference = sections(report, Plot)
    assert [(s.start, s.end) for s in position.spans] == [(1.0, 3.0), (4.0, 4.0)]
    assert [s.name for s in position.series] == ["with backlash", "without", "reference"]
    assert list(difference.series[0].y) == [0.0, 0.5, 1.5, 2.5, 2.5]


@pytest.mark.parametrize("command", ["simulate", "ssp"])
def test_the_page_of_a_scenario_groups_signals_by_unit(tmp_path, command):
    head = ("signal", "unit", "first", "last", "smallest", "largest")
    rows = [
        ("a.x", "rad", "0", "1", "0", "1"),
        ("a.v", "rad/s", "0", "1", "0", "1"),
        ("b.x", "rad", "0", "1", "0", "1"),
    ]
    signals = [dict(zip(head, row, strict=True)) for row in rows]
    write_result(tmp_path, command, {"scenario": "s.toml"}, None, {"signals": signals, "steps": 1})
    (tmp_path / f"{command}.csv").write_text("time,a.x,a.v,b.x\n0,0,0,0\n1,1,1,1\n")
    plots = sections(report_from_directory(tmp_path), Plot)
    assert [[s.name for s in p.series] for p in plots] == [["a.x", "b.x"], ["a.v"]]


@pytest.mark.parametrize("command", ["build", "ssp"])
def test_commands_without_a_page_of_their_own_get_facts_and_tables(tmp_path, command):
    results = {
        "count": 2,
        "ratio": 1.5,
        "rows": [{"name": "a", "time": 1.0}, {"name": "b", "time": None}],
        "deep": {"x": 1},
    }
    write_result(tmp_path, command, {}, None, results)
    report = report_from_directory(tmp_path)
    (table,) = sections(report, ReportTable)
    assert table.rows == (("a", 1.0), ("b", None))
    assert [s.title for s in report.sections] == ["Results", "Rows", "Deep"]


def test_report_rebuilds_the_same_page_and_leaves_nothing_else(sweep, capsys):
    before = write_report(sweep).read_bytes()
    (sweep / "report.html").unlink()
    assert main(["report", str(sweep)]) == 0
    assert capsys.readouterr().out == f"{sweep / 'report.html'}\n"
    assert (sweep / "report.html").read_bytes() == before
    assert sorted(p.name for p in sweep.iterdir()) == ["report.html", "sweep.csv", "sweep.json"]


def test_a_page_that_cannot_be_moved_into_place_leaves_nothing(sweep):
    (sweep / "report.html").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*report.html"):
        write_report(sweep)
    assert sorted(p.name for p in sweep.iterdir()) == ["report.html", "sweep.csv", "sweep.json"]


def test_several_results_in_one_directory_are_told_apart(sweep):
    write_result(sweep, "check", {}, None, as_results([]))
    with pytest.raises(ScenarioError, match=r"but has those of check, sweep: choose with `command`"):
        report_from_directory(sweep)
    assert report_from_directory(sweep, "sweep").title == "Backlash sweep"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "must be JSON"),
        ("[]", "must be the result"),
        ('{"command": "check", "results": {}}', "must be the result"),
        ('{"command": "sweep", "results": {}}', "must hold results of this version"),
        ('{"command": "sweep", "results": {"cases": "x", "failed": 0}}', "must hold results of this version"),
    ],
)
def test_damaged_results_are_one_line_and_exit_2(tmp_path, capsys, content, said):
    (tmp_path / "sweep.json").write_text(content)
    assert main(["report", str(tmp_path)]) == 2
    errors = capsys.readouterr().err
    assert said in errors
    assert errors.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["sweep.json"]


def test_a_damaged_table_is_named(sweep, capsys):
    (sweep / "sweep.csv").write_text("case,status\n1,2,3\n")
    assert main(["report", str(sweep)]) == 2
    assert "sweep.csv must be a CSV table" in capsys.readouterr().err


def test_a_missing_table_is_named(sweep, capsys):
    (sweep / "sweep.csv").unlink()
    assert main(["report", str(sweep)]) == 2
    assert "sweep.csv must be the table of a sweep" in capsys.readouterr().err


def test_an_empty_directory_a_missing_one_and_an_unknown_command_are_named(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "has none" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "missing")]) == 2
    assert "`DIR` must be an existing folder" in capsys.readouterr().err
    for command in ("", "../sweep"):
        assert main(["report", str(tmp_path), "--command", command]) == 2
        told = capsys.readouterr().err
        assert f"`--command` must be one of {', '.join(COMMANDS)}, but is {command!r}" in told


@pytest.mark.parametrize("command", COMMANDS)
def test_no_results_at_all_make_a_page_or_one_line(tmp_path, command, capsys):
    (tmp_path / f"{command}.json").write_text(json.dumps({"command": command, "results": {}}))
    code = main(["report", str(tmp_path)])
    assert code in {0, 2}
    assert (tmp_path / "report.html").exists() == (code == 0)
    assert "Traceback" not in capsys.readouterr().err


def test_the_page_of_a_sweep_of_any_scenario_plots_its_results(tmp_path):
    results = {"cases": 2, "failed": 0, "columns": [{"name": "a.y.last", "unit": "rad"}], "scenario": {"name": "s"}}
    write_result(tmp_path, "sweep", {"vary": ["a.k=1,2", "a.model=x,y"]}, 0, results)
    (tmp_path / "sweep.csv").write_text("case,a.k,a.model,status,a.y.last,message\n0,1,x,done,5,\n1,2,y,done,,\n")
    report = report_from_directory(tmp_path)
    assert (report.title, report.summary) == ("Sweep of s", "2 of 2 cases are done, over a.k=1,2, a.model=x,y.")
    by_number, by_word = sections(report, Plot)
    assert (by_number.x_label, by_number.y_label) == ("a.k", "a.y [rad]")
    assert [s.name for s in by_number.series] == ["last"]
    assert (by_number.series[0].x, by_number.series[0].y) == ([1.0, 2.0], [5.0, None])
    assert by_number.series[0].labels == ["case 0, a.model x", "case 1, a.model y"]
    assert (by_word.x_label, by_word.categories, by_word.series[0].x) == ("a.model", ("x", "y"), [0.0, 1.0])


def test_the_page_of_a_paired_sweep_shows_what_another_parameter_does_to_the_error(tmp_path):
    results = {"cases": 2, "failed": 0, "columns": [asdict(c) | {"kind": ""} for c in COLUMNS]}
    write_result(tmp_path, "sweep", {}, 0, results)
    rows = ["0,0.0,1,5.5,0.02,done,1,0.019,0.018,0.02,1e-3,5.0,", "1,0.0,1,5.7,0.02,done,1,0.022,0.02,0.03,2e-3,10.0,"]
    head = "case,noise,repetition,plant.J_l,alpha,status,S,estimate,lower,upper,error,error_percent,message"
    (tmp_path / "sweep.csv").write_text("\n".join([head, *rows, ""]))
    plots = {p.title: p for p in sections(report_from_directory(tmp_path), Plot)}
    (series,) = plots["Error against plant.J_l"].series
    assert (series.x, series.y) == ([5.5, 5.7], [pytest.approx(-5.0), pytest.approx(10.0)])


def test_the_page_of_a_large_sweep_shows_part_of_it_and_says_so(tmp_path):
    count = 10_000
    results = {"cases": count, "failed": 0, "columns": [{"name": "y", "unit": "rad"}]}
    write_result(tmp_path, "sweep", {}, 0, results)
    lines = [f"{i},{i / count},done,{i}," for i in range(count)]
    (tmp_path / "sweep.csv").write_text("\n".join(["case,k,status,y,message", *lines, ""]))
    report = report_from_directory(tmp_path)
    (plot,) = sections(report, Plot)
    assert 3000 <= len(plot.series[0].x) <= 4000
    assert plot.series[0].x[-1] > 0.999
    assert "The first 500 of 10000 rows" in write_report(tmp_path).read_text()


@dataclass(frozen=True)
class Choice:
    """An argument as commands hand it on."""

    ratio: float
    names: tuple[str, ...] = ()


class Limits(msgspec.Struct):
    select: tuple[str, ...]
    limits: dict[str, float]
    choice: Choice


def test_arguments_of_the_program_s_own_kinds_are_told_in_words(tmp_path):
    given = {"policy": Limits(("unit.*", "xml"), {}, Choice(2.5)), "where": tmp_path}
    write_result(tmp_path, "build", given, None, {"fmus": {}})
    origin = dict(report_from_directory(tmp_path).origin)
    assert origin["policy"] == "select: unit.*, xml, choice: ratio: 2.5"
    assert origin["where"] == str(tmp_path)
