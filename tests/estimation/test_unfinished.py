"""A fit that is ended before it is done keeps what it has: at twice the processor time that was told, and at Ctrl-C."""

import io
import json
import os
import re
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.commands import _budget, _stages
from orchestrator.commands import _estimating as command
from orchestrator.commands._budget import Budget
from orchestrator.commands._stages import Stages
from orchestrator.errors import ConvergenceError
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.estimation.settings import EstimationSettings, MaximisationSettings
from orchestrator.estimation.trust import trust_of_estimates
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record, write_csv

GAP = 0.03
COLUMNS, _ = make_record({"alpha": GAP}, 8, 5.0, 100.0)


class EndsAfter:
    """Says to end once it was asked so often."""

    def __init__(self, most: int) -> None:
        self.asked, self.most = 0, most

    def __call__(self) -> str:
        self.asked += 1
        return "a reason" if self.asked > self.most else ""


@pytest.fixture
def record() -> Record:
    return record_from_columns(COLUMNS, "unfinished")


def test_a_fit_that_is_ended_says_so_and_keeps_its_best(record: Record) -> None:
    whole = EndsAfter(10**9)
    done = maximum_likelihood.estimate(record, default_model(), threads=1, stop=whole)
    assert "stopped" not in done.diagnostics
    late = maximum_likelihood.estimate(record, default_model(), threads=1, stop=EndsAfter(whole.asked - 5))
    assert late.alpha == done.alpha  # the interval alone was not done
    assert late.interval == pytest.approx(done.interval, abs=2.0 * done.standard_error)
    early = maximum_likelihood.estimate(record, default_model(), threads=1, stop=EndsAfter(whole.asked // 3))
    assert early.alpha == pytest.approx(GAP, rel=0.2)
    assert early.interval[0] < early.alpha < early.interval[1]
    for found in (late, early):
        assert "ended before it was done (a reason)" in found.message
        assert not found.diagnostics["converged"]
        trust = trust_of_estimates([found], default_model())["maximum_likelihood"]
        assert trust.level.word != "green"
        assert any("a reason" in reason for reason in trust.reasons)


def test_a_fit_of_the_beginning_is_shown_on_all_rows(record: Record) -> None:
    settings = EstimationSettings(fit=MaximisationSettings(long_record=300, short_record=250))
    found = maximum_likelihood.estimate(record, default_model(), threads=1, stop=EndsAfter(150), settings=settings)
    assert found.curves["states"].shape == (record.size, 5)
    assert np.isfinite(found.interval).all()


def test_all_rows_are_fitted_again_where_the_beginning_leads_astray() -> None:
    """With an exact model, errors of the beginning's values grow over the rest until no step leads back."""
    columns, _ = make_record({"alpha": 0.01}, 81, 8.0, 500.0)
    settings = EstimationSettings(fit=MaximisationSettings(long_record=1000, short_record=800))
    found = maximum_likelihood.estimate(record_from_columns(columns, "r"), default_model(), settings=settings)
    assert found.standard_error < 1e-5
    assert found.interval[0] < 0.01 < found.interval[1]


def test_missing_samples_do_not_make_a_fit_look_worse() -> None:
    def deviance_of_row(outputs: np.ndarray) -> float:
        said = SimpleNamespace(deviance=-15.0 * np.count_nonzero(np.isfinite(outputs)))
        return maximum_likelihood._deviance_of_row(
            cast(Any, SimpleNamespace(point=said, likelihood=SimpleNamespace(problem=SimpleNamespace(outputs=outputs))))
        )

    whole = np.zeros((40, 2))
    some = whole.copy()
    some[10:20, 0] = some[15:30, 1] = np.nan
    assert deviance_of_row(some) == pytest.approx(deviance_of_row(whole)) == -30.0


def test_before_a_first_size_there_is_nothing_to_keep(record: Record) -> None:
    with pytest.raises(ConvergenceError, match="a reason"):
        maximum_likelihood.estimate(record, default_model(), threads=1, stop=EndsAfter(3))


def test_ctrl_c_ends_the_command_with_what_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupts(Budget):
        asked = 0

        def why(self) -> str:
            Interrupts.asked += 1
            if Interrupts.asked == 400:
                os.kill(os.getpid(), signal.SIGINT)
            return super().why()

    monkeypatch.setattr(command, "Budget", Interrupts)
    write_csv(tmp_path / "log.csv", COLUMNS)
    out = tmp_path / "out"
    assert main(["estimate", str(tmp_path / "log.csv"), "--out", str(out)]) == 130
    told = re.search(r"will take about (\d+) s of processor time; a diagnosis.* (\d+) s more", capsys.readouterr().err)
    assert told is not None
    results = json.loads((out / "estimate.json").read_text())["results"]
    assert results["alpha"] == pytest.approx(GAP, rel=0.2)
    assert "interrupted" in results["message"]
    assert results.get("diagnosis") is None
    assert (out / "report.html").is_file()


def test_work_ends_at_twice_what_was_told(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [50.0]
    monkeypatch.setattr(_budget.time, "process_time", lambda: now[0])
    budget = Budget()
    assert budget.why() == ""
    budget.begin(10.0)
    now[0] = 69.0
    assert budget.why() == ""
    now[0] = 71.0
    assert budget.why() == "21 s of processor time, twice what was expected"
    budget.begin(10.0)
    assert budget.why() == ""


def test_a_second_ctrl_c_ends_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(_budget.time, "monotonic", lambda: now[0])
    budget, before = Budget(), signal.getsignal(signal.SIGINT)
    with budget.catching():
        signal.raise_signal(signal.SIGINT)
        assert budget.why() == "interrupted"
        now[0] = 0.5
        signal.raise_signal(signal.SIGINT)  # the same one, sent twice
        now[0] = 2.0
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_the_bar_never_goes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(_stages.time, "monotonic", lambda: now[0])
    stages = Stages(io.StringIO())
    stages.begin("fitting", 10.0)
    now[0] = 7.5
    stages._line()
    assert stages._done == pytest.approx(0.75)
    stages.at("fitting on", 0.25)  # which says that the whole takes 30 s
    stages._line()
    assert stages.time_left() == pytest.approx(22.5)
    assert stages._done == pytest.approx(0.75)
