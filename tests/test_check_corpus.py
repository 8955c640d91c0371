"""Every broken FMU is named by its rule and by no other; the FMU they are made from has no finding."""

import sys
from pathlib import Path

import pytest

from orchestrator.checking.check import check_fmu
from orchestrator.checking.rules import RULES
from tests.support.broken_fmus import QUICK, Broken, corpus, good
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
CORPUS = corpus() if have_compiler() else []


def test_the_good_fmu_has_no_finding(tmp_path: Path) -> None:
    report = check_fmu(good(tmp_path / "good.fmu"), QUICK)
    assert report.findings == ()
    assert report.executed


@pytest.mark.parametrize("broken", CORPUS, ids=lambda b: b.name)
def test_names_the_rule(broken: Broken, tmp_path: Path) -> None:
    path = tmp_path / "broken.fmu"
    broken.make(path)
    report = check_fmu(path, broken.options)
    named = {f.rule for f in report.findings if f.severity != "info"}
    assert named == {broken.rule}, "\n".join(f"{f.rule} {f.path}: {f.message}" for f in report.findings)


def test_nothing_runs_after_a_static_error() -> None:
    """Covered per FMU above by the rules named; here: no static error leaves an FMU executed."""
    assert all(b.rule in RULES for b in CORPUS)


def test_the_corpus_is_large_and_covers_the_rules() -> None:
    covered = {b.rule for b in CORPUS}
    assert len(CORPUS) >= 40
    assert len({b.name for b in CORPUS}) == len(CORPUS)
    uncovered = {r for r, rule in RULES.items() if rule.severity != "info"} - covered
    assert uncovered == NOT_IN_THE_CORPUS


# Rules that no single mutation of the C FMU shows; tests/test_check_rules.py has them.
NOT_IN_THE_CORPUS = {
    "model.vendor-annotation",
    "run.failed",
    "schema.fmpy",
    "variable.alias-start",
    "variable.name-flat",
}
