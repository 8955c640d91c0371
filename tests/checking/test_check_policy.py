"""``fmu-check.toml`` and baselines: which rules count, how much, and what is refused."""

from pathlib import Path

import pytest

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.findings import Finding, FmuFindings
from orchestrator.checking.policy import Policy, read_policy
from orchestrator.checking.verdict import baseline_of, judge, read_baseline
from orchestrator.cli import main
from orchestrator.errors import InputError
from tests.support.c_fmu import fmu_files, have_compiler, write_fmu

FINDINGS = (Finding("model.guid", "", "no Z"), Finding("misuse.guid", "", "accepted"))


def policy(tmp_path: Path, text: str) -> Policy:
    path = tmp_path / "fmu-check.toml"
    path.write_text(text, encoding="utf-8")
    return read_policy(path)


@pytest.mark.parametrize(
    ("text", "rules", "ok"),
    [
        ("", ["model.guid", "misuse.guid"], False),
        ('ignore = ["model.*"]', ["misuse.guid"], True),
        ('select = ["misuse.*"]\nfail-on = "warning"', ["misuse.guid"], False),
        ('[severity]\n"model.guid" = "info"', ["misuse.guid", "model.guid"], True),
        ('[severity]\n"misuse.*" = "error"\n[[fmu]]\nfmu = "*.fmu"\nignore = ["model.guid"]', ["misuse.guid"], False),
        ('[[fmu]]\nfmu = "old/*.fmu"\nignore = ["*"]', [], True),
        ('[[fmu]]\nfmu = "new/*.fmu"\nignore = ["*"]', ["model.guid", "misuse.guid"], False),
        ('ignore = ["*"]\n[[fmu]]\nfmu = "a.fmu"\nselect = ["misuse.guid"]', ["misuse.guid"], True),
    ],
)
def test_rules_are_selected_ignored_and_rated(text: str, rules: list[str], ok: bool, tmp_path: Path) -> None:
    verdict = judge(FmuFindings("old/a.fmu", FINDINGS), policy(tmp_path, text))
    assert [issue.finding.rule for issue in verdict.issues] == rules
    assert verdict.ok is ok


def test_a_rule_that_does_not_count_was_not_run(tmp_path: Path) -> None:
    verdict = judge(FmuFindings("a.fmu", FINDINGS), policy(tmp_path, 'ignore = ["model.guid"]'))
    (outcome,) = (o for o in verdict.outcomes if o.rule == "model.guid")
    assert (outcome.outcome, outcome.reason) == ("not run", "the policy ignores it")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('ignor = ["model.guid"]', "unknown field `ignor`"),
        ('ignore = ["model.guids"]', "`ignore` must name a rule or a group such as `archive.*`, but is 'model.guids'"),
        ('[severity]\n"model.guid" = "bad"', "'bad'"),
        ('fail-on = "never"', "'never'"),
        ('[[fmu]]\nignore = ["model.guid"]', "missing required field `fmu`"),
        ('[[fmu]]\nfmu = "a.fmu"\nignore = ["x"]', "`fmu[0].ignore` must name a rule"),
        ("select = [", "must be a valid policy file"),
        ("select = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        ("\xff", "must name a rule"),
    ],
)
def test_a_wrong_policy_is_refused_with_the_place(text: str, words: str, tmp_path: Path) -> None:
    if text == "\xff":
        text, words = 'select = ["\xff"]', "must name a rule"
    with pytest.raises(InputError) as caught:
        policy(tmp_path, text)
    assert words in str(caught.value)


def test_a_baseline_knows_what_it_was_written_for_and_nothing_else(tmp_path: Path) -> None:
    verdict = judge(FmuFindings("a.fmu", FINDINGS), Policy())
    (tmp_path / "known.json").write_text(baseline_of([verdict]), encoding="utf-8")
    rules = policy(tmp_path, 'baseline = "known.json"\nfail-on = "warning"')
    known = read_baseline(Path(rules.baseline))
    assert judge(verdict.report, rules, known).ok
    more = FmuFindings("a.fmu", (*FINDINGS, Finding("model.guid", "", "no Z")))
    assert not judge(more, rules, known).ok
    assert not judge(FmuFindings("b.fmu", FINDINGS), rules, known).ok


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"known": [{"rule": "x"}]}', "[" * 10**5])
def test_a_file_that_is_no_baseline_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "known.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="the baseline"):
        read_baseline(tmp_path / "known.json")


@pytest.mark.skipif(not have_compiler(), reason="the FMU is built with a C compiler")
def test_the_command_takes_policy_and_baseline(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files = fmu_files("guid_ignored")  # a warning of a run, and one of its date without a run
    xml = files["modelDescription.xml"].replace(b"00:00:00Z", b"00:00:00")
    write_fmu(tmp_path / "a.fmu", files | {"modelDescription.xml": xml})
    assert main(["check", "a.fmu", "--write-baseline", "known.json"]) == 0
    assert main(["check", "a.fmu", "--static", "--fail-on", "warning"]) == 1
    assert main(["check", "a.fmu", "--fail-on", "warning", "--baseline", "known.json"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("a.fmu: 2 known (executed")
    Path("fmu-check.toml").write_text('fail-on = "warning"', encoding="utf-8")
    assert main(["check", "a.fmu", "--static"]) == 1
    assert main(["check", "a.fmu", "--policy", "none.toml"]) == 2


def test_every_rule_can_be_named() -> None:
    assert Policy().severities("a.fmu") == {name: rule.severity for name, rule in RULES.items()}
