"""Where a finding stands: line and column of modelDescription.xml, in every report, and one entry for equal faults."""

import json
import sys
import zipfile
from pathlib import Path

import pytest

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.findings import FmuFindings
from orchestrator.checking.formats.code_quality import as_code_quality
from orchestrator.checking.formats.github import as_annotations
from orchestrator.checking.formats.sarif import as_sarif
from orchestrator.checking.formats.text import as_lines
from orchestrator.checking.policy import Policy
from orchestrator.checking.verdict import Verdict, judge

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<!-- a comment\nof two lines -->\n'
ROOT = '<fmiModelDescription fmiVersion="2.0" modelName="ä" guid="g" generationDateAndTime="2026-01-01T00:00:00Z">'
STEPS = '<CoSimulation modelIdentifier="m"/>'


def variable(number: int, unit: str) -> str:
    attributes = f'name="v{number}" valueReference="{number}" variability="continuous" causality="local"'
    return f'\t<ScalarVariable {attributes}>\n    <Real unit="{unit}"/></ScalarVariable>'


def check(tmp_path: Path, text: str, folder: bool = False) -> FmuFindings:
    path = tmp_path / "m.fmu"
    if folder:
        path.mkdir()
        (path / "modelDescription.xml").write_text(text, encoding="utf-8")
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", text)
    return check_fmu(path, CheckOptions(static=True))


def described(*units: str) -> str:
    variables = "\n".join(variable(n, unit) for n, unit in enumerate(units))
    body = f"{STEPS}<ModelVariables>\n{variables}\n</ModelVariables>\n<ModelStructure/>"
    return f"{HEAD}{ROOT}\n{body}\n</fmiModelDescription>"


def verdict_of(report: FmuFindings) -> Verdict:
    return judge(report, Policy())


def test_a_finding_has_the_line_and_column_of_its_element(tmp_path: Path) -> None:
    report = check(tmp_path, described("N", "furlong"))
    places = {f.path: (f.line, f.column) for f in report.findings if f.rule == "variable.unit"}
    path = "modelDescription.xml:/fmiModelDescription/ModelVariables/ScalarVariable[{}]/Real/@unit"
    assert places == {path.format(1): (7, 5), path.format(2): (9, 5)}


def test_columns_count_characters_and_lines_those_of_attributes_too(tmp_path: Path) -> None:
    text = described("N").replace("<CoSimulation", "<!-- äöü€ --> <CoSimulation\n").replace('"m"', '"1m"')
    (found,) = (f for f in check(tmp_path, text).findings if f.rule == "model.identifier")
    assert (found.line, found.column) == (5, 15)


def test_every_report_says_the_line(tmp_path: Path) -> None:
    verdict = verdict_of(check(tmp_path, described("N")))
    (issue,) = [i for i in verdict.issues if i.finding.rule == "variable.unit"]
    index = verdict.issues.index(issue)
    result = json.loads(as_sarif([verdict]))["runs"][0]["results"][index]
    region = result["locations"][0]["physicalLocation"]
    assert region["region"] == {"startLine": 7, "startColumn": 5}
    assert region["artifactLocation"]["uri"].endswith("m.fmu")
    assert "line 7, column 5" in result["message"]["text"]
    (annotation,) = (line for line in as_annotations([verdict]) if "title=variable.unit" in line)
    assert ",line=7,col=5," in annotation
    (entry,) = (e for e in json.loads(as_code_quality([verdict])) if e["check_name"] == "variable.unit")
    assert entry["location"]["lines"]["begin"] == 7
    assert any("(line 7, column 5)" in line for line in as_lines(verdict))


def test_a_platform_is_shown_the_description_of_an_unpacked_fmu(tmp_path: Path) -> None:
    verdict = verdict_of(check(tmp_path, described("N"), folder=True))
    uris = {
        r["ruleId"]: r["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        for r in json.loads(as_sarif([verdict]))["runs"][0]["results"]
    }
    assert uris["variable.unit"].endswith("m.fmu/modelDescription.xml")


def test_equal_faults_are_one_in_the_terminal_and_each_in_json(tmp_path: Path) -> None:
    verdict = verdict_of(check(tmp_path, described(*(f"u{n}" for n in range(9)))))
    lines = as_lines(verdict)
    assert sum("variable.unit" in line for line in lines) == 1
    (more,) = (line for line in lines if "the same at" in line)
    assert "ScalarVariable[2]" in more
    assert more.endswith("and 3 more")
    assert sum(i.finding.rule == "variable.unit" for i in verdict.issues) == 9


def test_the_terminal_names_the_section_of_the_fmus_version_alone(tmp_path: Path) -> None:
    lines = as_lines(verdict_of(check(tmp_path, described("N"))))
    (advice,) = (line for line in lines if "UnitDefinitions" in line and "->" in line)
    assert advice.endswith("(FMI 2.0.4, section 2.2.7)")


def test_xml_that_is_none_is_told_with_its_place(tmp_path: Path) -> None:
    for text, words, place in (
        (described("N").replace("</ModelVariables>", ""), "mismatched tag", (10, 3)),
        (f"{HEAD}<a b='1' b='2'/>", "duplicate attribute", (4, 10)),
        (f"{HEAD}<a>&x;</a>", "undefined entity", (4, 4)),
        (f"{HEAD}<a/><b/>", "junk after document element", (4, 5)),
        (f"{HEAD}<a", "unclosed token", (4, 1)),
        (f"{HEAD}<a>", "no element found", (4, 4)),
        (f"{HEAD}<p:a/>", "strict readers refuse it", (0, 0)),
    ):
        (tmp_path / "m.fmu").unlink(missing_ok=True)
        (found,) = check(tmp_path, text).findings
        assert found.rule == "xml.malformed"
        assert words in found.message
        assert (found.line, found.column) == place


@pytest.mark.skipif(sys.platform != "linux", reason="the file is one of Linux")
def test_a_file_that_cannot_be_read_has_a_finding_and_no_hash(tmp_path: Path) -> None:
    """Memory of this process: a file that can be opened, but not read at its beginning."""
    report = check_fmu(Path("/proc/self/mem"), CheckOptions(static=True))
    assert [f.rule for f in report.findings] == ["archive.not-a-zip"]
    assert "sha256" not in report.facts
    assert "sha256" in check(tmp_path, described("N")).facts
