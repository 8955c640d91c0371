"""The repair of one FMU: archive, description, token, library; what is mended shows what else is wrong."""

import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lxml import etree

from orchestrator.building.archive import write_archive
from orchestrator.building.launcher import compile_launcher, find_toolchain
from orchestrator.checking.findings import Finding
from orchestrator.checking.mending.description import mend_description, mend_token
from orchestrator.checking.mending.members import DESCRIPTION, UnmendableError, read_members
from orchestrator.checking.mending.structure import mend_structure
from orchestrator.checking.static import check_static
from orchestrator.checking.xml_reading import parse
from orchestrator.errors import FmuError
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.scratch import Scratch

_MOST_ROUNDS = 5
_MARK = "resources/slavemodule.txt"  # by which PythonFMU's library finds the class
_FOLDER = "binaries/linux64"
_GUID = "resources/guid.txt"  # with which the launcher compares what a host hands over


@dataclass(frozen=True)
class Repair:
    """What became of one FMU."""

    done: tuple[str, ...]  # what was mended, a line each; empty: nothing, and no file was written
    left: tuple[str, ...]  # what could not be mended, and why


def mend_fmu(path: Path, target: Path, limits: ArchiveLimits | None = None) -> Repair:
    """Write an FMU anew without faults that need no source, executing nothing; return what was mended, and not."""
    limits = limits or ArchiveLimits()
    if target.exists() and target.samefile(path):
        raise FmuError(f"the mended FMU must be another file, but is {path} itself")
    members, done = read_members(path, limits)
    left: list[str] = []
    with Scratch("mend") as scratch:
        for number in range(_MOST_ROUNDS):
            findings = _findings(scratch.path / f"{number}.fmu", members, limits)
            guid, mended = _mend_xml(members, findings)
            if number == 0:
                library, left = _mend_library(members, guid, findings)
                mended += library
            done += mended
            if not mended:
                break
    if done:
        write_archive(target, members)
    return Repair(tuple(dict.fromkeys(done)), tuple(left))


def _findings(path: Path, members: Mapping[str, bytes], limits: ArchiveLimits) -> list[Finding]:
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    result = check_static(path, limits)
    if result.files is not None:
        result.files.close()
    path.unlink()
    return result.findings


def _mend_xml(members: dict[str, bytes], findings: list[Finding]) -> tuple[str, list[str]]:
    """Mend the description; return the guid of FMI 2.0, and what was mended."""
    root, problems = parse(members[DESCRIPTION], DESCRIPTION)
    if root is None:
        raise UnmendableError(f"{DESCRIPTION} must be mended, but this cannot be: {problems[0].message}")
    done = [f"wrote {DESCRIPTION} in UTF-8" for problem in problems if problem.rule == "xml.encoding"]
    done += mend_description(root, findings) + mend_token(root, members) + mend_structure(root, findings)
    if done:
        etree.indent(root)
        members[DESCRIPTION] = etree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return root.get("guid", ""), done


def _mend_library(members: dict[str, bytes], guid: str, findings: list[Finding]) -> tuple[list[str], list[str]]:
    """Give a library of PythonFMU that loads in Python programs alone our launcher; what was mended, and what not."""
    paths = [f.path for f in findings if f.rule == "binary.python-symbols"]
    place = next((p for p in paths if str(PurePosixPath(p).parent) == _FOLDER), None)
    if place is None or _MARK not in members:
        return [], []
    toolchain = find_toolchain()
    if toolchain.compiler is None:
        return [], [f"{place} loads in Python programs only; its launcher needs a C compiler (cc) on Linux"]
    library = members[place]
    wrapper = f"pythonfmu-{hashlib.sha256(library).hexdigest()[:12]}.so"
    members[place] = compile_launcher(toolchain, wrapper)
    members[f"{_FOLDER}/{wrapper}"] = library
    members[_GUID] = guid.encode()
    return [f"put a launcher in the place of {place}, which brings a Python to programs that have none"], []
