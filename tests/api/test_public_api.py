"""``import orchestrator as oc``: quick, complete, and what the docs show runs as it stands."""

import doctest
import os
import re
import rlcompleter
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import orchestrator as oc
from tests.support.example_record import copy_examples

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
FUNCTIONS = sorted(name for name in oc.__all__ if name.islower() and not name.startswith("_"))
# Examples that take more than a few seconds.
SLOW = {"benchmark", "calibrate"}
# The same calls as those of the page; the search of an excitation is in tests/estimation/test_estimate.py by day.
AT_NIGHT = {"design", "diagnose", "estimate"}


@pytest.fixture
def place(tmp_path, monkeypatch, fmus, build_native):
    """A folder with the files that the docs speak of, as the current one; hundreds of runs of the axis are quick."""
    copy_examples(tmp_path)
    shutil.copy(fmus["LqrController"], tmp_path / "other.fmu")  # that is soon checked
    shutil.copy(build_native(["ServoAxis"])["ServoAxis"], tmp_path / "axis.fmu")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(code, folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_completion_shows_the_public_names_and_nothing_else():
    completer = rlcompleter.Completer({"oc": oc})
    shown = {re.match(r"oc\.(\w+)", text)[1] for text in completer.attr_matches("oc.")}
    public = {name for name in oc.__all__ if not name.startswith("_")}
    assert shown == public
    assert set(dir(oc)) == set(oc.__all__)


def test_every_public_name_exists():
    for name in oc.__all__:
        assert getattr(oc, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        oc.nothing  # noqa: B018


def test_no_public_name_is_also_a_module():
    for name in oc.__all__:
        assert not (ROOT / "orchestrator" / name).exists(), name
        assert not (ROOT / "orchestrator" / f"{name}.py").exists(), name


def test_the_stub_is_sorted_and_names_what_is_there():
    """Type checkers and editors read it in place of the lazy names, which are read from it."""
    first, *lines = (ROOT / "orchestrator" / "__init__.pyi").read_text(encoding="utf-8").splitlines()
    assert first.startswith("#")
    assert lines == sorted(lines)
    assert len(lines) == len(oc.__all__) > 50
    for name in oc.__all__:
        assert getattr(oc, name) is not None, name
    with pytest.raises(AttributeError, match="no attribute 'anything'"):
        _ = oc.anything


def test_importing_loads_no_workflow(tmp_path):
    heavy = "numpy", "scipy", "fmpy", "matplotlib", "rich", "msgspec"
    code = f"import sys, orchestrator; print([n for n in {heavy!r} if n in sys.modules])"
    done = run(code, tmp_path)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "more", [", diagnose=False", pytest.param("", marks=pytest.mark.night)], ids=["by day", "whole"]
)
def test_the_page_runs_as_written(place, more):
    """By day without the diagnosis of the estimate, which is the one of the next line."""
    code = "\n".join(BLOCK.findall((ROOT / "docs" / "python.md").read_text(encoding="utf-8")))
    assert "found.build" in code
    assert code.count("oc.estimate(record, model)") == 1
    code = code.replace("oc.estimate(record, model)", f"oc.estimate(record, model{more})")
    done = run(code + "\nprint(theta.shape, fmu, len(sweep))", place)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("(2001,) out/Drivetrain_machine.fmu 40")
    for name in ("signals.png", "out/Drivetrain_machine.fmu", "sweep.csv", "results/pair/report.html"):
        assert (place / name).stat().st_size > 1000
    assert done.stderr == ""


def marks_of(name):
    return pytest.mark.night if name in AT_NIGHT else pytest.mark.slow if name in SLOW else ()


@pytest.mark.parametrize("name", [pytest.param(n, marks=marks_of(n)) for n in FUNCTIONS])
def test_example_of_the_docstring(place, name):
    function = getattr(oc, name)
    example = doctest.DocTestParser().get_doctest(function.__doc__, {"oc": oc}, name, None, 0)
    assert example.examples, f"{name} has no example"
    if name == "read_record":  # it shows how long the record is
        copy_examples(place, whole=True)
    result = doctest.DocTestRunner(verbose=False).run(example)
    assert result.failed == 0


def test_results_show_themselves(place):
    pair = oc.run_pair(alpha=0.02)
    assert "actual half-gap" in str(pair)
    assert "0.02" in str(pair)
    assert repr(pair) == str(pair)  # what a prompt shows is the result, and no address
    assert pair._repr_html_().count("<tr>") == 1 + len(pair.blocks()[0].rows)
    with pytest.raises(KeyError, match=r"must be one of plant.theta_m, .* but is 'plant.x'"):
        oc.simulate("loop.toml")["plant.x"]


def test_errors_carry_the_name_of_the_argument(place):
    for call, name in (
        (lambda: oc.run_pair(alpha=-1.0), "alpha"),
        (lambda: oc.run_pair(experiment="no"), "experiment"),
        (lambda: oc.sweep(seeds=0), "seeds"),
        (lambda: oc.sweep(noise=[0.0, 0.0]), "noise"),
        (lambda: oc.sweep(sizes="random:0"), "sizes"),
        (lambda: oc.sweep(workers=0), "workers"),
        (lambda: oc.estimate("machine.csv", method="guess"), "method"),
        (lambda: oc.simulate("loop.toml", step=0.1), "step"),
        (lambda: oc.build(["Gear"]), "names"),
        (lambda: oc.run_pair().save("machine.csv"), "out"),
    ):
        with pytest.raises(oc.InputError) as caught:
            call()
        assert name in caught.value.arguments
        assert f"`{name}`" in str(caught.value)


def test_the_reference_has_every_public_name_once():
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "api").glob("*.md")]
    shown = re.findall(r"^::: orchestrator\.(\w+)$", "\n".join(pages), re.MULTILINE)
    assert sorted(shown) == sorted(name for name in oc.__all__ if not name.startswith("_"))
