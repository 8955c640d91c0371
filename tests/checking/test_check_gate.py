"""Formal faults keep no probe from running; what was not executed does not pass."""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.check import check_fmu
from orchestrator.errors import FmuError
from orchestrator.fmi.model_description import read_description
from tests.support.ball3 import ball_files
from tests.support.broken_archives import pack
from tests.support.broken_fmus import QUICK
from tests.support.c_fmu import LIBRARY, fmu_files, have_compiler, write_fmu

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
XML = "modelDescription.xml"
Files = dict[str, bytes]


def _edited(old: str, new: str) -> Callable[[Files], Files]:
    def change(files: Files) -> Files:
        text, count = re.subn(old, new, files[XML].decode(), count=1)
        assert count == 1
        return files | {XML: text.encode()}

    return change


FORMAL = {
    "date with milliseconds": ("model.date", _edited("00:00Z", "00:00.125Z")),
    "date of a time zone": ("model.date", _edited("00:00Z", "00:00-05:00")),
    "no date at all": ("schema.invalid", _edited('generationDateAndTime="[^"]*"', 'generationDateAndTime="today"')),
    "Latin-1": ("xml.encoding", _edited("UTF-8", "ISO-8859-1")),
    "initial unknown missing": ("structure.initial-unknowns", _edited("(?s)<InitialUnknowns>.*</InitialUnknowns>", "")),
    "an attribute of a vendor": ("schema.invalid", _edited("<CoSimulation", '<CoSimulation vendorFlag="1"')),
    "unit unknown": ("type.unit", _edited('unit="m"', 'unit="ell"')),
    "another platform without library": (
        "binary.missing",
        lambda files: files | {"binaries/win64/other.dll": b"MZ"},
    ),
}


@pytest.mark.parametrize("probes", [("life cycle",), pytest.param((), marks=pytest.mark.night)], ids=["a run", "all"])
@pytest.mark.parametrize("name", FORMAL)
def test_a_formal_fault_is_found_and_the_fmu_runs_all_the_same(
    name: str, probes: tuple[str, ...], tmp_path: Path
) -> None:
    rule, change = FORMAL[name]
    report = check_fmu(write_fmu(tmp_path / "formal.fmu", change(fmu_files())), replace(QUICK, probes=probes))
    assert {f.rule for f in report.findings} == {rule}
    assert report.executed
    assert set(report.executions[0].stages.values()) == {""}


def test_a_fault_of_behaviour_is_seen_behind_a_formal_one(tmp_path: Path) -> None:
    files = _edited("00:00Z", "00:00.5Z")(fmu_files("crash_step"))
    report = check_fmu(write_fmu(tmp_path / "both.fmu", files), QUICK)
    assert {f.rule for f in report.findings} == {"model.date", "run.crash", "run.skipped"}
    assert {o.rule for o in report.outcomes if o.outcome == "failed"} == {"model.date", "run.crash", "run.skipped"}


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda files: files | {LIBRARY: b"hello\n"}, "binary.format"),
        (lambda files: {k: v for k, v in files.items() if k != LIBRARY}, "binary.none"),
        (lambda files: {k.replace("linux64", "darwin64").replace(".so", ".dylib"): v for k, v in files.items()}, None),
    ],
    ids=["text as library", "neither binary nor source", "another platform"],
)
def test_what_was_not_executed_does_not_pass(
    change: Callable[[Files], Files], rule: str | None, tmp_path: Path
) -> None:
    path = write_fmu(tmp_path / "idle.fmu", change(fmu_files()))
    report = check_fmu(path, QUICK)
    assert not report.ok
    assert not report.executed
    assert report.not_executed
    assert (rule or "binary.format") in {f.rule for f in report.findings}


def test_the_only_library_is_run_whatever_its_name(tmp_path: Path) -> None:
    files = _edited('modelIdentifier="[^"]*"', 'modelIdentifier="Other"')(fmu_files())
    report = check_fmu(write_fmu(tmp_path / "other.fmu", files), QUICK)
    assert {f.rule for f in report.findings} == {"binary.missing"}
    assert report.executed
    assert not report.ok


def test_of_several_libraries_that_of_the_model_is_run(tmp_path: Path) -> None:
    files = fmu_files()
    report = check_fmu(write_fmu(tmp_path / "two.fmu", files | {f"{LIBRARY[:-3]}_more.so": files[LIBRARY]}), QUICK)
    assert {f.rule for f in report.findings if f.severity == "error"} == set()
    assert report.executed


def test_an_fmu_without_a_library_for_this_machine_passes_when_only_reading_is_asked_for(tmp_path: Path) -> None:
    files = fmu_files()
    del files[LIBRARY]
    path = write_fmu(tmp_path / "sources.fmu", files | {"sources/model.c": b"int x;\n"})
    report = check_fmu(path, QUICK)
    assert [(f.rule, f.severity) for f in report.findings] == [
        ("binary.not-here", "warning"), ("run.not-executed", "warning"),
    ]  # fmt: skip
    assert not report.executed
    assert not check_fmu(path, replace(QUICK, static=True)).findings[1:]


def test_messages_have_their_arguments(tmp_path: Path) -> None:
    report = check_fmu(write_fmu(tmp_path / "logs.fmu", fmu_files("logs_arguments")), QUICK)
    (finding,) = (f for f in report.findings if f.rule == "run.status")
    assert "(a 7 -3 0x1f 99999999999 tank 2.50 x 1e-09 50% 8)" in finding.message


ODD_NAMES = {
    "the archive's own folder": ([("./", b"")], {"archive.odd-name"}),
    "folders of Windows": ([("resources\\", b"")], {"archive.backslash"}),
    "folders twice": ([("resources/", b""), ("resources/", b"")], set()),
    "a file twice": ([("resources/readme.txt", b"nothing is needed here\n")], {"archive.repeated"}),
    "a file twice, with a dot": (
        [("./resources/readme.txt", b"nothing is needed here\n")],
        {"archive.repeated", "archive.odd-name"},
    ),
}


@pytest.mark.parametrize("name", ODD_NAMES)
def test_odd_entries_of_an_archive_keep_nothing_from_running(name: str, tmp_path: Path) -> None:
    more, rules = ODD_NAMES[name]
    report = check_fmu(pack(tmp_path / "odd.fmu", [*more, *fmu_files().items()]), QUICK)
    assert {f.rule for f in report.findings} == rules
    assert report.executed


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda name: f"./{name}", "archive.odd-name"),
        (lambda name: name.replace("/", "\\"), "archive.backslash"),
        (lambda name: name.replace("/", "//"), "archive.odd-name"),
    ],
    ids=["dots", "backslashes", "empty folders"],
)
def test_odd_paths_are_one_finding_and_keep_nothing_from_running(change, rule: str, tmp_path: Path) -> None:
    path = pack(tmp_path / "odd.fmu", [(change(name), data) for name, data in fmu_files().items()])
    report = check_fmu(path, QUICK)
    assert [f.rule for f in report.findings] == [rule]
    assert report.executed
    assert set(report.executions[0].stages.values()) == {""}
    assert read_description(path) == read_description(write_fmu(tmp_path / "plain.fmu", fmu_files()))


@pytest.mark.parametrize("name", [XML, f"./{XML}", LIBRARY.replace("/", "\\")])
def test_two_contents_of_one_path_are_refused(name: str, tmp_path: Path) -> None:
    path = pack(tmp_path / "two.fmu", [*fmu_files().items(), (name, b"<other/>")])
    report = check_fmu(path, QUICK)
    assert "archive.duplicate" in {f.rule for f in report.findings}
    assert not report.executed
    with pytest.raises(FmuError, match="has two contents"):
        read_description(path)


@pytest.mark.parametrize("behaviour", ["logs_address", "missing_function", "undefined_symbol"])
def test_findings_are_the_same_in_each_run_so_that_a_baseline_knows_them(behaviour: str, tmp_path: Path) -> None:
    path = write_fmu(tmp_path / "a.fmu", fmu_files(behaviour))
    first, second = (check_fmu(path, QUICK).findings for _ in range(2))
    assert first == second
    text = " ".join(f.message for f in first)
    assert str(tmp_path) not in text
    assert "/fmu/" not in text
    assert behaviour != "logs_address" or "<Slave object at 0x...> cannot go on" in text


def test_an_exception_of_python_that_a_call_leaves_hides_no_status(tmp_path: Path) -> None:
    report = check_fmu(write_fmu(tmp_path / "a.fmu", fmu_files("python_exception")), QUICK)
    (finding,) = report.findings
    assert (finding.rule, finding.severity) == ("run.python-exception", "warning")
    assert finding.message.endswith("TypeError: nobody cleared me")
    assert set(report.executions[0].stages.values()) == {""}


@pytest.mark.parametrize(("starts", "wrong"), [("1 2 3", 0), ("1 2 4", 1), ("9 9 9", 3)])
def test_a_wrong_start_of_an_array_is_one_finding(starts: str, wrong: int, tmp_path: Path) -> None:
    files = ball_files("")
    files[XML] = files[XML].replace(b'start="1 2 3"', f'start="{starts}"'.encode())
    found = [f for f in check_fmu(write_fmu(tmp_path / "a.fmu", files), QUICK).findings if f.rule == "value.start"]
    assert len(found) == min(wrong, 1)
    assert wrong < 2 or "2 more of its 3 elements" in found[0].message


def test_the_checker_is_loaded_without_the_packages_that_its_distribution_lacks() -> None:
    """`fmu-check` installs on lxml and msgspec alone, and on the parts of this package that its setup.py names."""
    code = (
        "import sys, orchestrator.commands._fmu_check, orchestrator.checking.check, orchestrator.checking.dynamic\n"
        "print(*sorted({name.split('.')[0] for name in sys.modules} & {'numpy', 'scipy', 'pint', 'fmpy'}))\n"
        "print(*sorted(n for n in sys.modules if n.startswith(('orchestrator.master', 'orchestrator.fmi'))))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
