"""Reports for platforms: valid by their schemas, and the same run says the same in each."""

import json
import re
from collections import Counter
from pathlib import Path

import jsonschema
import pytest
from lxml import etree

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.findings import Execution, Finding, FmuFindings
from orchestrator.checking.formats.code_quality import as_code_quality
from orchestrator.checking.formats.github import MOST_ANNOTATIONS, as_annotations, as_summary
from orchestrator.checking.formats.junit import as_junit
from orchestrator.checking.formats.sarif import FINGERPRINT, MOST_RESULTS, SCHEMA, as_sarif
from orchestrator.checking.policy import Policy
from orchestrator.checking.verdict import Verdict, judge
from tests.support.schemas import CODE_QUALITY, json_schema, junit_schema

STAGES = {rule.stage for rule in RULES.values()}
ERROR, WARNING = "variable.unit", "misuse.guid"


def report(*findings: Finding, fmu: str = "fmus/a b.fmu") -> FmuFindings:
    """A run in which the last stage was not carried out."""
    static = dict.fromkeys(("archive", "xml", "schema", "description", "files", "binaries"), "")
    probes = dict.fromkeys(sorted(STAGES - static.keys()), "") | {"reference": "there is no reference result"}
    return FmuFindings(fmu, findings, "2.0", static, (Execution("CoSimulation", probes),))


def mixed(policy: Policy | None = None, baseline: frozenset[str] = frozenset()) -> list[Verdict]:
    """Failed, passed and not executed rules; hostile texts; a second FMU without findings."""
    bad = report(
        Finding(ERROR, "modelDescription.xml:/a[3]/@unit", "the unit `<&\"'\x00\x1b]` must be defined,\n::error::x"),
        Finding(ERROR, "modelDescription.xml:/a[4]/@unit", "the unit `N.m` must be defined"),
        Finding(WARNING, "(misuse)", "accepted a wrong guid 3.5 times"),
    )
    return [judge(r, policy or Policy(), baseline) for r in (bad, report(fmu="good.fmu"))]


def test_sarif_is_valid_and_says_which_rules_failed_passed_and_were_not_run() -> None:
    document = json.loads(as_sarif(mixed()))
    assert document["$schema"] == SCHEMA
    jsonschema.validate(document, json_schema(SCHEMA))
    (run,) = document["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert [rules[r["ruleIndex"]]["id"] for r in run["results"]] == [ERROR, ERROR, WARNING]
    assert [r["level"] for r in run["results"]] == ["error", "error", "warning"]
    location = run["results"][0]["locations"][0]["physicalLocation"]
    assert location["artifactLocation"]["uri"] == "fmus/a%20b.fmu"
    passed = run["properties"]["passed"]
    assert ERROR not in passed["fmus/a b.fmu"]
    assert ERROR in passed["good.fmu"]
    notes = run["invocations"][0]["toolExecutionNotifications"]
    not_run = {name for name, rule in RULES.items() if rule.stage == "reference" and "2.0" in rule.versions}
    assert Counter(n["descriptor"]["id"] for n in notes) == Counter([*not_run] * 2)


def test_rules_of_sarif_name_the_place_in_the_standard() -> None:
    (run,) = json.loads(as_sarif(mixed()))["runs"]
    rules = {r["id"]: r for r in run["tool"]["driver"]["rules"]}
    assert set(rules) == {name for name, rule in RULES.items() if "2.0" in rule.versions}
    texts = "FMI 2.0.4, section 2.2.7; FMI 3.0.2, section 2.4.7.5"
    assert rules[ERROR]["fullDescription"]["text"] == f"The unit is defined. ({texts})"
    assert rules[ERROR]["help"]["text"] == f"Add it to UnitDefinitions. Source: {texts}."
    assert rules[ERROR]["helpUri"] == "https://fmi-standard.org/docs/3.0.2/#_type_specific_properties"
    assert f"section 2.4.7.5]({rules[ERROR]['helpUri']})" in rules[ERROR]["help"]["markdown"]
    own = rules["archive.not-a-zip"]
    assert "helpUri" not in own
    assert own["help"]["markdown"].endswith("Source: a rule of fmu-check, not of the standard.")
    for name, rule in rules.items():
        assert rule["help"]["text"].startswith(RULES[name].advice[0].upper())


def test_fingerprints_stay_when_places_and_measured_numbers_change() -> None:
    def fingerprints(*findings: Finding) -> list[str]:
        (run,) = json.loads(as_sarif([judge(report(*findings), Policy())]))["runs"]
        return [r["partialFingerprints"][FINGERPRINT] for r in run["results"]]

    unit = Finding(ERROR, "modelDescription.xml:/a[3]/@unit", "the unit `x1` must be defined")
    moved = Finding(ERROR, "modelDescription.xml:/a[7]/@unit", "the unit `x1` must be defined")
    other = Finding(ERROR, "modelDescription.xml:/a[3]/@unit", "the unit `x2` must be defined")
    grown = [Finding(WARNING, "", f"memory must not grow, but grew by {n} MiB") for n in (3.25, 4)]
    assert fingerprints(unit) == fingerprints(moved) != fingerprints(other)
    assert fingerprints(grown[0]) == fingerprints(grown[1])
    assert len(set(fingerprints(unit, moved))) == 2


def test_junit_is_valid_and_has_a_case_for_each_rule() -> None:
    root = etree.fromstring(as_junit(mixed()).encode())
    junit_schema().assertValid(root)
    applicable = [name for name, rule in RULES.items() if "2.0" in rule.versions]
    assert [[c.get("name") for c in suite] for suite in root] == [applicable, applicable]
    bad, good = root
    assert [c.get("name") for c in bad if c.find("failure") is not None] == [ERROR]
    assert [c.get("name") for c in bad if c.find("system-out") is not None] == [WARNING]
    assert {c.find("skipped").get("message") for c in good if len(c)} == {"there is no reference result"}
    assert (bad.get("failures"), good.get("failures")) == ("1", "0")
    assert root.get("tests") == str(2 * len(applicable))


def test_code_quality_is_valid_and_leaves_known_findings_out() -> None:
    issues = json.loads(as_code_quality(mixed()))
    jsonschema.validate(issues, CODE_QUALITY)
    assert [(i["check_name"], i["severity"]) for i in issues] == [(ERROR, "major")] * 2 + [(WARNING, "minor")]
    known = frozenset(i["fingerprint"] for i in issues[1:])
    verdicts = mixed(baseline=known)
    assert [i["fingerprint"] for i in json.loads(as_code_quality(verdicts))] == [issues[0]["fingerprint"]]
    (run,) = json.loads(as_sarif(verdicts))["runs"]
    assert ["suppressions" in r for r in run["results"]] == [False, True, True]


def test_annotations_are_one_command_a_line() -> None:
    lines = as_annotations(mixed())
    assert [line.split(" ")[0] for line in lines] == ["::error", "::error", "::warning"]
    assert all(re.fullmatch(r"::\w+ file=[^:,]+,title=[\w.-]+::[^\x00-\x1f]+", line) for line in lines)
    many = [Finding(ERROR, "", f"the unit `{n}`") for n in range(30)]
    assert len(as_annotations([judge(report(*many), Policy())])) == MOST_ANNOTATIONS


def test_the_summary_of_a_step_is_a_table_that_no_name_breaks() -> None:
    lines = as_summary([*mixed(), judge(report(fmu="a|b<c>.fmu"), Policy())]).splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert {line.count("|") for line in rows} == {6, 7}
    assert "| **failed** |" in rows[2]
    assert "a&#124;b&lt;c>.fmu" in rows[4]


def test_sarif_keeps_the_worst_where_platforms_would_refuse_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orchestrator.checking.formats.sarif.MOST_RESULTS", 2)
    (run,) = json.loads(as_sarif(mixed()))["runs"]
    assert [r["ruleId"] for r in run["results"]] == [ERROR, ERROR]
    assert "1 further results" in run["invocations"][0]["toolExecutionNotifications"][-1]["message"]["text"]
    assert MOST_RESULTS == 5000


def test_what_is_below_the_working_directory_is_named_from_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    inside, relative = (judge(report(fmu=str(f)), Policy()) for f in (tmp_path / "x" / "a.fmu", Path("x/a.fmu")))
    assert as_summary([inside]) == as_summary([relative])
