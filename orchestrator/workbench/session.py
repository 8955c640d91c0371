"""The directory of a session: files that were handed in, and a folder of results for each job.

::

    DIR/files/axis.csv             what was uploaded, and model files that were written
    DIR/results/estimate-3/        what the command wrote, with job.json: the command line and how it ended
    DIR/session.json               what the page keeps: choices, the drawn scenario, which results are shown
"""

import os
import re
import secrets
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from orchestrator.errors import InputError, OutputError, ScenarioError
from orchestrator.shared.operating_system import PLAIN_FILE
from orchestrator.shared.output import write_whole
from orchestrator.shared.scratch import remove
from orchestrator.shared.toml_files import read_toml
from orchestrator.workbench.settings import MEBIBYTE

FILES, RESULTS = "files", "results"
LONGEST_NAME = 120
DEEPEST = 6  # folders of a result: those of an unpacked report, and no endless path
_GONE = ".gone-"
_MODEL_KEYS = {"fmu", "columns", "encoders", "parameters", "header"}
_NAME = re.compile(r"[^\x00-\x1f\x7f/\\:]+")


@dataclass(frozen=True)
class SessionFolder:
    """A session's directory; see ``open_session``."""

    folder: Path

    @property
    def files(self) -> Path:
        """Return the folder of uploads."""
        return self.folder / FILES

    @property
    def results(self) -> Path:
        """Return the folder of results."""
        return self.folder / RESULTS

    def path_of(self, reference: str) -> Path:
        """Return the file that a page speaks of, such as ``files/axis.csv``; refuse everything outside, and links.

        Raises:
            InputError: it is none of this session's files.
        """
        parts = reference.split("/")
        inside = parts[0] in (FILES, RESULTS) and 2 <= len(parts) <= DEEPEST and all(map(is_name, parts))
        path = self.folder.joinpath(*parts) if inside else self.folder
        if not inside or path.resolve() != path or not path.is_file():
            raise InputError(f"`file` must be a file of this session, but is {reference[:LONGEST_NAME]!r}")
        return path

    def reserve_file(self, name: str) -> Path:
        """Return a new, empty file of this name among the uploads; a number is added where there is one already.

        Raises:
            InputError: the name has a folder, or is none.
        """
        if not is_name(name):
            raise InputError(
                f"`name` must be a file's name of at most {LONGEST_NAME} bytes, without folders and not hidden, "
                f"but is {name[:LONGEST_NAME]!r}"
            )
        stem, dot, suffix = name.partition(".")
        for number in range(1, 10_000):
            path = self.files / (name if number == 1 else f"{stem}-{number}{dot}{suffix}")
            try:
                os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | PLAIN_FILE, 0o600))
            except FileExistsError:
                continue
            except OSError as error:
                raise OutputError(f"cannot write {path}: {error.strerror}") from None
            return path
        raise InputError(f"`name` must be new, but there are 10,000 files called {name!r}")

    def write_file(self, name: str, text: str) -> Path:
        """Write a text among the uploads, whole or not at all, and return its path."""
        path = self.reserve_file(name)
        try:
            write_whole(path, text)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        return path

    def reserve_result(self, command: str) -> Path:
        """Return a new, empty folder for the results of a command: ``results/COMMAND-N``."""
        taken = [int(path.name.rpartition("-")[2]) for path in self.results.glob(f"{command}-[0-9]*")
                 if path.name.rpartition("-")[2].isdigit()]  # fmt: skip
        number = max(taken, default=0)
        while True:
            number += 1
            try:
                (self.results / f"{command}-{number}").mkdir()
            except FileExistsError:  # another page was quicker
                continue
            return self.results / f"{command}-{number}"

    def remove_result(self, name: str) -> None:
        """Remove a folder of results: out of sight in one step, and then from the disk."""
        gone = self.results / f"{_GONE}{secrets.token_hex(8)}"
        (self.results / name).rename(gone)
        remove(gone)

    def reference_of(self, path: Path) -> str:
        """Return what a page calls a file."""
        return path.relative_to(self.folder).as_posix()

    def bytes_of_files(self) -> int:
        """Return the size of all uploads."""
        return sum(path.stat().st_size for path in self.files.iterdir() if path.is_file())


def is_name(text: str) -> bool:
    """Return whether a text is a plain file name: no folder, no hidden file, nothing that a system reads otherwise."""
    plain = _NAME.fullmatch(text) is not None and len(text.encode("utf-8", "replace")) <= LONGEST_NAME
    return plain and not text.startswith((".", "-")) and text == text.strip()


def kind_of(path: Path) -> str:
    """Return what an upload is: a log, model, map, settings, scenario or fmu; "other" what a page only keeps."""
    ending = path.suffix.lower()
    if ending in (".fmu", ".ssp"):
        return "fmu"
    if ending != ".toml":
        return "other" if ending in (".json", ".html", ".png") else "log"
    return _kind_of_toml(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=1000)
def _kind_of_toml(path: Path, changed: int) -> str:
    try:
        found = read_toml(path, MEBIBYTE).keys()
    except ScenarioError:
        return "model"  # where it is chosen, its reader says what is wrong
    if "outputs" in found:
        return "map"
    if not found or found & _MODEL_KEYS:
        return "model"
    return "scenario" if "instances" in found else "settings"


def open_session(folder: Path) -> SessionFolder:
    """Return the session of a directory, which is made where there is none; what lies there stays."""
    session = SessionFolder(folder.absolute())
    try:
        session.files.mkdir(parents=True, exist_ok=True)
        session.results.mkdir(exist_ok=True)
        for gone in session.results.glob(f"{_GONE}*"):  # what a server that was killed had begun to remove
            remove(gone)
        os.chmod(session.folder, 0o700)  # data of machines: of this user alone
    except OSError as error:
        raise OutputError(f"`out` must be a writable directory, but {folder} is not: {error.strerror}", "out") from None
    return SessionFolder(session.folder.resolve())
