"""A mutant is caught by a test that fails, not by a run that is killed."""

import pytest

from tools.mutants import outcome

TESTS = {
    "survived": "def test_it(): pass",
    "caught": "def test_it(): assert False",
    "no end": "import os\ndef test_it(): os.kill(os.getpid(), 9)",
}


@pytest.mark.parametrize("expected", TESTS)
def test_the_outcome_of_a_run(tmp_path, expected):
    (tmp_path / "test_one.py").write_text(TESTS[expected])
    assert outcome(tmp_path, ("test_one.py",)) == expected
