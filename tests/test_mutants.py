"""A mutant is caught by a test that fails, not by a run that is killed."""

import shutil

import pytest

from tools import mutants

COMPUTE = "import time\nwhile time.process_time() < 3.0: pass"
TESTS = {
    "passes": ("def test_it(): pass", "survived", ""),
    "fails": ("def test_it(): assert False", "caught", "test_one.py::test_it"),
    "cannot be collected": ("import nothing_of_this_name", "caught", "test_one.py"),
    "is killed": ("import os\ndef test_it(): os.kill(os.getpid(), 9)", "no end", ""),
    "computes without end": ("def test_it():\n    while True: pass", "no end", ""),
    "waits without end": ("import time\ndef test_it(): time.sleep(1000)", "no end", ""),
    "has a child that computes for longer": (
        f"import subprocess, sys\ndef test_it(): subprocess.run([sys.executable, '-c', {COMPUTE!r}], check=True)",
        "survived",
        "",
    ),
}


@pytest.fixture
def root(tmp_path):
    """A copy that has the tools alone."""
    shutil.copytree(mutants.ROOT / "tools", tmp_path / "copy" / "tools")
    return tmp_path / "copy"


@pytest.mark.parametrize("what", TESTS)
def test_the_outcome_of_a_run(root, monkeypatch, what):
    text, *expected = TESTS[what]
    monkeypatch.setattr(mutants, "TIME_LIMIT", 2.0)
    if what.startswith("waits"):
        monkeypatch.setattr(mutants, "CLOCK_LIMIT", 4.0)
    (root / "test_one.py").write_text(text)
    assert mutants.outcome(root, ("test_one.py",)) == (expected[0], [name for name in expected[1:] if name])


def test_tests_of_the_changed_function_come_first(root):
    (root / "orchestrator").mkdir()
    (root / "orchestrator" / "__init__.py").touch()
    (root / "orchestrator" / "sums.py").write_text("def add(a, b):\n    return a + b\n")
    (root / "test_one.py").write_text(
        "from orchestrator.sums import add\ndef test_other(): pass\ndef test_sum(): assert add(1, 1) == 2\n"
        "def test_last(): pass\n"
    )
    assert mutants.outcome(root, ("test_one.py",)) == ("survived", [])
    (root / "orchestrator" / "sums.py").write_text("def add(a, b):\n    return a - b\n")
    (root / "test_one.py").write_text((root / "test_one.py").read_text().replace("pass", "assert False"))
    assert mutants.outcome(root, ("test_one.py",), place="orchestrator/sums.py:2") == (
        "caught",
        ["test_one.py::test_sum"],
    )


def test_all_tests_that_catch_a_mutant_are_noted(root, capsys):
    (root / "test_one.py").write_text("def test_a(): pass\ndef test_b(): assert False\ndef test_c(): assert False\n")
    names = ["test_one.py::test_b", "test_one.py::test_c"]
    assert mutants.outcome(root, ("test_one.py",), every=True) == ("caught", names)
    caught = [{"outcome": "caught", "by": names}, {"outcome": "caught", "by": names[1:]}, {"outcome": "survived"}]
    mutants.print_tests([{"by": []} | entry for entry in caught])
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["2", "1", names[1]], ["1", "0", names[0]],
    ]  # fmt: skip
