"""A first step that is discarded, with the end of the run asked for, is an error; a later one is none."""

from pathlib import Path

import pytest

from orchestrator.checking.check import check_fmu
from tests.support.python_fmus import build_python_fmu, slave_source


@pytest.mark.parametrize(
    ("returns", "wrong"), [("pass", True), ("return time > 0.0", True), ("return time < 0.2", False)]
)
def test_a_python_slave_is_told_what_it_must_return(tmp_path: Path, returns: str, wrong: bool) -> None:
    result = check_fmu(build_python_fmu(tmp_path / "slave", slave_source(f"self.y = time + step\n{returns}")))
    texts = [f.message for f in result.findings if f.rule == "run.status"]
    assert len(texts) == wrong
    assert all("a first step must be done, but is discarded" in t and "`return True` in Python" in t for t in texts)
