"""What the thesis printed, recomputed."""

import json

import pytest

from orchestrator.cli import main
from orchestrator.paired.thesis import published
from orchestrator.paired.thesis.errata import errata
from orchestrator.paired.thesis.recompute import gain_comparisons, size_hidden_in_the_filter, table_comparison
from orchestrator.shared.results import as_plain, read
from orchestrator.shared.results.thesis import ThesisFound


def test_every_printed_gain_is_recovered():
    agrees = {c.what: c.agrees for c in gain_comparisons()}
    assert agrees == {
        "A, row 2": False,
        "A, row 4": True,
        "K": True,
        "K_fl, with backlash": True,
        "K_flno, without": True,
    }


def test_table_4_1():
    table = table_comparison()
    assert table.largest_deviation < 0.0145
    assert table.mean_error_percent == pytest.approx(3.02, abs=0.005)
    assert table.mse == pytest.approx(7.399e-3, rel=1e-4)
    for printed, error in zip(published.TABLE_4_1, table.errors_percent, strict=True):
        assert error == pytest.approx(printed.error_percent, abs=0.006)


def test_the_filter_was_told_the_size():
    assert size_hidden_in_the_filter() == pytest.approx(4.48754, abs=1e-4)


def test_errata_are_complete_and_show_numbers():
    found = errata()
    assert [e.number for e in found] == list(range(1, 10))
    assert "rank 5 of 6" in found[1].right
    assert found[1].shown_by.startswith("the design is refused")
    assert "+1 N.m with +1/tau and -1 N.m with -1/tau" in found[3].shown_by
    late, early = (float(word) for word in found[8].shown_by.split() if word.startswith("0."))
    assert late > early


def test_the_command_writes_everything(tmp_path, capsys):
    assert main(["thesis", "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "Table 4.1" in text
    assert "7.399e-03" in text
    results = json.loads((tmp_path / "out" / "thesis.json").read_text())["results"]
    assert json.loads(json.dumps(as_plain(read(results, ThesisFound)))) == results
    assert len(results["errata"]) == 9
    assert (
        max(abs(e - r.alpha) for e, r in zip(results["table"]["our_estimates"], published.TABLE_4_1, strict=True))
        < 1e-3
    )
