"""The benchmark of single steps of the plant runs, over ordinary machines and over the whole legal range."""

import sys

import pytest

from benchmarks.plant_steps import effects, main
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS


@pytest.mark.parametrize("words", [[], ["--extreme"]])
def test_each_model_has_its_row(words: list[str], monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["plant_steps", "--runs", "1", "--steps", "1", *words])
    main()
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert [row[0] for row in rows] == list(BACKLASH_MODELS)
    assert all(int(row[1]) == len(effects()) for row in rows)
