"""Archives of others: unpacked whole or not at all, inside their folder, within their limits."""

import os
import stat
import zipfile
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.errors import FmuError, OutputError
from orchestrator.shared.isolation import archives
from orchestrator.shared.isolation.archives import ArchiveLimits, require_fit, unpack
from tests.support.broken_archives import pack
from tests.support.c_fmu import LIBRARY, model_description

ENTRIES = {"modelDescription.xml": b"<x/>", "resources/a/b.txt": b"text", "empty/": b""}


def archive_of(path: Path, entries: dict[str, bytes], **attributes: int) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            info = zipfile.ZipInfo(name)
            info.compress_type = zipfile.ZIP_DEFLATED
            for key, value in attributes.items():
                setattr(info, key, value)
            archive.writestr(info, content)
    return path


def test_files_and_folders_come_out(tmp_path: Path) -> None:
    unpack(archive_of(tmp_path / "a.zip", ENTRIES), tmp_path / "out")
    assert (tmp_path / "out" / "modelDescription.xml").read_bytes() == b"<x/>"
    assert (tmp_path / "out" / "resources" / "a" / "b.txt").read_bytes() == b"text"
    assert (tmp_path / "out" / "empty").is_dir()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zip", "out"]


def test_an_empty_archive_is_an_empty_folder(tmp_path: Path) -> None:
    unpack(archive_of(tmp_path / "a.zip", {}), tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(
    "name",
    ["../evil", "a/../../evil", "..\\evil", "a/..", "/etc/evil", "C:/evil", "a:b", "\\evil", "good/../../../evil"],
)
def test_names_that_lead_out_are_refused_and_leave_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "in").mkdir()
    path = archive_of(tmp_path / "in" / "a.zip", {"first.txt": b"1", name: b"evil"})
    target = tmp_path / "in" / "deep" / "out"
    target.parent.mkdir()
    with pytest.raises(FmuError, match="must lie within the archive"):
        unpack(path, target)
    assert list(target.parent.iterdir()) == []
    assert not list(tmp_path.rglob("evil"))
    assert not Path("/etc/evil").exists()


def test_links_are_refused(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.zip", {"link": b"/etc/passwd"}, external_attr=(stat.S_IFLNK | 0o777) << 16)
    with pytest.raises(FmuError, match="must lie within the archive, but 'link' does not"):
        unpack(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def members(*sizes: tuple[int, int]) -> list[zipfile.ZipInfo]:
    found = []
    for size, packed in sizes:
        info = zipfile.ZipInfo("m")
        info.file_size, info.compress_size = size, packed
        found.append(info)
    return found


def test_limits_are_reached_and_not_passed() -> None:
    limits, path = ArchiveLimits(total=4 << 20, files=2, ratio=10.0), Path("a.zip")
    mega = 1 << 20
    require_fit(members((mega, mega), (3 * mega, mega)), path, limits)
    with pytest.raises(FmuError, match=r"at most 2 members, but has 3"):
        require_fit(members((1, 1), (1, 1), (1, 1)), path, limits)
    with pytest.raises(FmuError, match=r"at most 4 MiB, but has 4194305 bytes"):
        require_fit(members((3 * mega, mega), (mega + 1, mega)), path, limits)
    require_fit(members((2 * mega, 2 * mega // 10 + 1)), path, limits)
    with pytest.raises(FmuError, match=r"at most 10 times its packed size, but unpacks to 11 times"):
        require_fit(members((2 * mega, 2 * mega // 11)), path, limits)
    require_fit(members((mega, 1)), path, limits)  # a small file may be packed tightly
    with pytest.raises(FmuError, match="packed size"):
        require_fit(members((mega + 1, 0)), path, limits)


def test_limits_hold_when_unpacking(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.zip", {"a": b"1", "b": b"2"})
    with pytest.raises(FmuError, match="at most 1 members"):
        unpack(path, tmp_path / "out", ArchiveLimits(files=1))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zip"]
    unpack(path, tmp_path / "out", ArchiveLimits(files=2))


def test_files_longer_than_a_chunk_come_out_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archives, "CHUNK", 7)
    content = os.urandom(100)
    unpack(archive_of(tmp_path / "a.zip", {"a": content}), tmp_path / "out")
    assert (tmp_path / "out" / "a").read_bytes() == content


class Liar(zipfile.ZipFile):
    """An archive whose directory says that every file is one byte shorter than it is."""

    def infolist(self):
        found = []
        for info in super().infolist():
            info.file_size -= 1
            found.append(info)
        return found

    def open(self, member, *arguments, **named):
        member.file_size += 1
        return super().open(member, *arguments, **named)


def test_a_file_larger_than_declared_is_refused(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.zip", {"a": b"0123456789"})
    folder = tmp_path / "part"
    with Liar(path) as archive:
        (member,) = archive.infolist()
        with pytest.raises(FmuError, match="declared size, but is larger"):
            archives._unpack_member(archive, member, folder, "a", path)


def test_damage_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    path = archive_of(tmp_path / "a.zip", {"a": os.urandom(1000)})
    data = bytearray(path.read_bytes())
    data[200] ^= 255
    path.write_bytes(data)
    with pytest.raises(FmuError, match="intact zip archive"):
        unpack(path, tmp_path / "out")
    with pytest.raises(FmuError, match=r"must exist, but .*missing.zip does not"):
        unpack(tmp_path / "missing.zip", tmp_path / "out")
    path.write_bytes(b"no zip")
    with pytest.raises(FmuError, match="intact zip archive"):
        unpack(path, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zip"]


def test_no_room_is_said_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = archive_of(tmp_path / "a.zip", {"a": b"1"})
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(OutputError, match="must be unpacked to"):
        unpack(path, blocker / "out")
    opened = Path.open

    class Full:
        def __init__(self, sink):
            self.sink = sink

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.sink.close()

        def write(self, _chunk):
            raise OSError(28, "No space left on device")

        def flush(self):
            """Nothing."""

    monkeypatch.setattr(Path, "open", lambda self, *a, **k: Full(opened(self, *a, **k)))
    with pytest.raises(OutputError, match="No space left on device"):
        unpack(path, tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zip", "file"]


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"resources/bomb": bytes(3 << 20)}, "at most 200 times its packed size"),
        ({"": b"x"}, "members must lie within the archive"),
        ({"../evil": b"x"}, "must lie within the archive"),
        ({f"m{k}": b"" for k in range(20_001)}, "at most 20000 members"),
    ],
    ids=["bomb", "unnamed", "outside", "many"],
)
def test_every_command_refuses_the_same_archives(
    tmp_path: Path, members: dict[str, bytes], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    good = {"modelDescription.xml": model_description().encode(), LIBRARY: b"never loaded"}
    fmu = archive_of(tmp_path / "a.fmu", good | members)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(
        'stop = 1.0\nrecord = ["a.x"]\n[master]\nalgorithm = "jacobi"\nstep = 0.1\n[instances.a]\nfmu = "a.fmu"\n'
    )
    out = str(tmp_path / "out")
    for words in (["simulate"], ["sweep", "--vary", "a.stiffness=1,2"]):
        assert main([*words, "--scenario", str(scenario), "--out", out]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
        assert not Path(out).exists()
    assert main(["check", str(fmu), "--out", out]) == 1
    assert "archive." in capsys.readouterr().out


def folder_without_a_slash() -> zipfile.ZipInfo:
    info = zipfile.ZipInfo("resources")
    info.external_attr = 0x10
    return info


PLAIN = {"modelDescription.xml": b"<x/>", "resources/a/b.txt": b"text"}
ODD = {
    "own folder": [("./", b"")],
    "own folder without a slash": [(".", b"")],
    "own folder of Windows": [(".\\", b"")],
    "folders that are listed twice": [("resources/", b""), ("resources/", b""), ("resources/a/", b"")],
    "folders with backslashes": [("resources\\", b""), ("resources\\a\\", b"")],
    "folder by its attribute": [(folder_without_a_slash(), b"")],
    "file twice": [("modelDescription.xml", b"<x/>")],
    "file twice, with a dot": [("./modelDescription.xml", b"<x/>"), ("resources//a/./b.txt", b"text")],
    "file twice, with a backslash": [("resources\\a\\b.txt", b"text")],
}


def tree(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("first", [True, False])
def test_odd_names_that_are_harmless_are_read(tmp_path: Path, odd: str, first: bool) -> None:
    entries = [*ODD[odd], *PLAIN.items()] if first else [*PLAIN.items(), *ODD[odd]]
    unpack(pack(tmp_path / "a.zip", entries), tmp_path / "out")
    assert tree(tmp_path / "out") == PLAIN


@pytest.mark.parametrize("change", [("/", "\\"), ("", "./"), ("/", "//"), ("/", "/./")])
def test_all_files_come_out_whatever_their_paths_look_like(tmp_path: Path, change: tuple[str, str]) -> None:
    old, new = change
    entries = [(name.replace(old, new) if old else new + name, content) for name, content in PLAIN.items()]
    unpack(pack(tmp_path / "a.zip", entries), tmp_path / "out")
    assert tree(tmp_path / "out") == PLAIN


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ([("modelDescription.xml", b"<y/>")], "'modelDescription.xml' has two contents"),
        ([("./modelDescription.xml", b"<y/>")], "'modelDescription.xml' has two contents"),
        ([("resources\\a\\b.txt", b"tex")], "'resources/a/b.txt' has two contents"),
        ([("resources", b"")], "'resources' is both"),
        ([("resources/a/b.txt/", b"")], "'resources/a/b.txt' has two contents"),
        ([("resources/a/b.txt/c", b"")], "'resources/a/b.txt' is both"),
        ([("/", b"")], "must lie within the archive, but '/' does not"),
    ],
)
def test_what_tools_would_take_differently_is_refused(tmp_path: Path, more, text: str) -> None:
    with pytest.raises(FmuError, match=text):
        unpack(pack(tmp_path / "a.zip", [*PLAIN.items(), *more]), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_same_checksum_is_not_the_same_content(tmp_path: Path) -> None:
    path = pack(tmp_path / "a.zip", [("a", b"plumless"), ("./a", b"buckeroo")])  # both have the CRC 0x4ddb0c25
    with zipfile.ZipFile(path) as archive:
        assert len({info.CRC for info in archive.infolist()}) == 1
    with pytest.raises(FmuError, match="'a' has two contents"):
        unpack(path, tmp_path / "out")
