"""Repairs: what can be mended without the source is mended into a new file, said, and passes; the rest stays."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.mending.members import UnmendableError
from orchestrator.checking.mending.mend import mend_fmu
from orchestrator.cli import main
from orchestrator.errors import FmuError
from tests.support.broken_archives import pack
from tests.support.c_fmu import GUID, LIBRARY, build_c_fmu, fmu_files, have_compiler, write_fmu

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
DESCRIPTION = "modelDescription.xml"
HOST = Path(__file__).resolve().parents[1] / "support" / "plain_host.c"
SLAVE = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Real

class Doubler(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 1.5
        self.y = 0.0
        self.ready = False
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Boolean("ready", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = 2.0 * self.u
        return True
"""


def errors(path: Path, static: bool = True) -> set[str]:
    return {f.rule for f in check_fmu(path, CheckOptions(static=static)).findings if f.severity == "error"}


def changed(*replacements: tuple[str, str]) -> dict[str, bytes]:
    """The files of the good FMU with texts of its description replaced."""
    files = fmu_files()
    text = files[DESCRIPTION].decode()
    for old, new in replacements:
        assert old in text, old
        text = text.replace(old, new, 1)
    return files | {DESCRIPTION: text.encode()}


def without(tag: str) -> dict[str, bytes]:
    """The files of the good FMU without an element of its description."""
    files = fmu_files()
    root = etree.fromstring(files[DESCRIPTION])
    for element in root.findall(f".//{tag}"):
        element.getparent().remove(element)
    return files | {DESCRIPTION: etree.tostring(root)}


FAULTS = {
    "initial unknowns are missing": (
        without("InitialUnknowns"), "structure.initial-unknowns", "added `der(x)`, `der(v)`",
    ),
    "outputs are missing": (without("Outputs"), "structure.outputs", "wrote the list Outputs anew"),
    "units are missing": (without("UnitDefinitions"), "variable.unit", "added the unit N"),
    "the guid is another one": (changed((GUID, "{0}")), "", f"wrote guid {GUID}, which the binaries hold, for {{0}}"),
    "the stop time is before the start": (
        changed(('startTime="0', 'startTime="7')), "model.experiment", "removed stopTime",
    ),
    "the encoding is another one": (changed(("UTF-8", "ISO-8859-1")), "xml.encoding", "in UTF-8"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_description_is_mended_and_said(fault: str, tmp_path: Path) -> None:
    files, rule, words = FAULTS[fault]
    path, target = write_fmu(tmp_path / "a.fmu", files), tmp_path / "b.fmu"
    before = path.read_bytes()
    assert rule in errors(path) | {""}
    repair = mend_fmu(path, target)
    assert any(words in line for line in repair.done), repair.done
    assert errors(target, static=False) == set()
    assert path.read_bytes() == before
    with zipfile.ZipFile(target) as archive:
        assert {n: archive.read(n) for n in files if n != DESCRIPTION} == {
            n: data for n, data in files.items() if n != DESCRIPTION
        }


def test_the_date_is_converted_where_its_zone_is_known(tmp_path: Path) -> None:
    root = etree.fromstring(fmu_files()[DESCRIPTION])
    date = root.get("generationDateAndTime")
    for written, mended in (
        ("2024-01-02T03:04:05+02:00", "2024-01-02T01:04:05Z"),
        ("2024-01-02T03:04:05.25Z", "2024-01-02T03:04:05Z"),
        ("2024-01-02T03:04:05", "2024-01-02T03:04:05Z"),
        ("yesterday", None),
    ):
        path = write_fmu(tmp_path / "a.fmu", changed((date, written)))
        repair = mend_fmu(path, tmp_path / "b.fmu")
        with zipfile.ZipFile(tmp_path / "b.fmu") as archive:
            assert etree.fromstring(archive.read(DESCRIPTION)).get("generationDateAndTime") == mended
        assert ("taken as UTC" in repair.done[0]) is (written == "2024-01-02T03:04:05")


def test_faults_of_the_archive_are_mended(tmp_path: Path) -> None:
    path, target = tmp_path / "a.fmu", tmp_path / "b.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in fmu_files().items():
            archive.writestr(f"model/{name}".replace("resources/", "resources\\"), data)
        with pytest.warns(UserWarning, match="Duplicate name"):
            archive.writestr(f"model/{DESCRIPTION}", fmu_files()[DESCRIPTION], zipfile.ZIP_BZIP2)
    repair = mend_fmu(path, target)
    assert errors(target, static=False) == set()
    text = "\n".join(repair.done)
    for words in ("removed repeated entries", "moved all files out of the folder model", "renamed", "deflate"):
        assert words in text
    assert b"nothing is needed" in zipfile.ZipFile(target).read("resources/readme.txt")


@pytest.mark.parametrize("fault", ["traversal", "two contents", "no description", "malformed", "no archive"])
def test_what_cannot_be_mended_is_refused_and_leaves_no_file(fault: str, tmp_path: Path) -> None:
    path, target = tmp_path / "a.fmu", tmp_path / "b.fmu"
    files = fmu_files()
    if fault == "no archive":
        path.write_bytes(b"PK")
    else:
        files |= {"malformed": {DESCRIPTION: b"<a"}, "traversal": {"../x": b""}}.get(fault, {})
        if fault == "no description":
            del files[DESCRIPTION]
        write_fmu(path, files)
    if fault == "two contents":
        with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
            archive.writestr(LIBRARY, b"another one")
    with pytest.raises(UnmendableError):
        mend_fmu(path, target)
    assert not target.exists()


def test_an_unpacked_fmu_is_mended_into_a_packed_one(tmp_path: Path) -> None:
    for name, data in without("InitialUnknowns").items():
        place = tmp_path / "model" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
    target = tmp_path / "mended.fmu"
    assert any("added `der(x)`" in line for line in mend_fmu(tmp_path / "model", target).done)
    assert errors(target) == set()
    with zipfile.ZipFile(target) as archive:
        assert set(archive.namelist()) == set(fmu_files())


def test_a_good_fmu_is_left_alone_and_no_fmu_is_overwritten(tmp_path: Path) -> None:
    path = build_c_fmu(tmp_path)
    assert mend_fmu(path, tmp_path / "b.fmu").done == ()
    assert not (tmp_path / "b.fmu").exists()
    with pytest.raises(FmuError, match="must be another file"):
        mend_fmu(path, path)


def test_the_command_says_what_it_mended_and_checks_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_fmu(Path("a.fmu"), without("InitialUnknowns"))
    build_c_fmu(Path(), name="good")
    Path("bad.fmu").write_bytes(b"PK")
    assert main(["check", "a.fmu"]) == 1
    assert main(["check", "a.fmu", "good.fmu", "--fix", "mended"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "a.fmu: mended as mended/a.fmu" in lines
    verdicts = {line.split(": ")[0]: line for line in lines if line.startswith(("mended/a.fmu: ", "good.fmu: "))}
    assert verdicts["mended/a.fmu"].startswith("mended/a.fmu: 1 info"), "no list says that parameters have no effect"
    assert any("of `enabled`, `gain`, `mode`" in line for line in lines)
    assert verdicts["good.fmu"].startswith("good.fmu: no findings")
    assert os.listdir("mended") == ["a.fmu"]
    assert main(["check", "bad.fmu", "--fix", "mended"]) == 1
    assert "bad.fmu: not mended" in capsys.readouterr().out
    assert main(["check", "a.fmu", str(Path("mended", "a.fmu")), "--fix", "more"]) == 2


@pytest.mark.slow
def test_an_fmu_of_pythonfmu_loads_in_a_host_without_python(tmp_path: Path) -> None:
    (tmp_path / "doubler.py").write_text(SLAVE, encoding="utf-8")
    build = [sys.executable, "-W", "ignore", "-m", "pythonfmu", "build", "-f", "doubler.py"]
    subprocess.run(build, cwd=tmp_path, check=True, capture_output=True)
    stock, target = tmp_path / "Doubler.fmu", tmp_path / "mended.fmu"
    host = tmp_path / "host"
    subprocess.run(["cc", "-o", host, HOST, "-ldl"], check=True)

    def run(fmu: Path) -> subprocess.CompletedProcess[str]:
        folder = tmp_path / fmu.stem
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        root = etree.parse(folder / DESCRIPTION).getroot()
        words = [folder / "binaries" / "linux64" / "Doubler.so", root.get("guid"), (folder / "resources").as_uri()]
        (reference,) = root.xpath("//ScalarVariable[@name='y']/@valueReference")
        clean = {"PATH": os.environ["PATH"]}
        command = [host, *words, "10", "0.1", reference]
        return subprocess.run(command, capture_output=True, text=True, check=False, env=clean)

    assert run(stock).returncode == 65  # the library does not load
    assert errors(stock) == {"structure.initial-unknowns", "variable.continuous-not-real"}
    repair = mend_fmu(stock, target)
    assert repair.left == ()
    assert errors(target, static=False) == set()
    done = run(target)
    assert (done.returncode, done.stdout) == (0, "3\n"), done.stderr


@pytest.mark.slow
def test_without_a_compiler_the_rest_is_mended_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "doubler.py").write_text(SLAVE, encoding="utf-8")
    build = [sys.executable, "-W", "ignore", "-m", "pythonfmu", "build", "-f", "doubler.py"]
    subprocess.run(build, cwd=tmp_path, check=True, capture_output=True)
    monkeypatch.setattr("orchestrator.building.launcher.local_compiler", lambda: None)
    repair = mend_fmu(tmp_path / "Doubler.fmu", tmp_path / "mended.fmu")
    assert "needs a C compiler" in repair.left[0]
    assert errors(tmp_path / "mended.fmu", static=False) == {"path.letters"}  # which only the launcher mends


def test_odd_folders_are_left_out(tmp_path: Path) -> None:
    entries = [("./", b""), *fmu_files().items(), ("resources\\", b"")]
    repair = mend_fmu(pack(tmp_path / "a.fmu", entries), tmp_path / "b.fmu")
    assert repair.done == ("left out the folder ./", "left out the folder resources\\")
    with zipfile.ZipFile(tmp_path / "b.fmu") as archive:
        assert {n: archive.read(n) for n in archive.namelist()} == fmu_files()
