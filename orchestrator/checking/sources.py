"""Sources that an FMU brings: a compiler reads them, with the macros and folders of the build description.

Nothing is linked and nothing of it is run; the compiler sees its own files and those of the FMU alone. Headers of FMI
are those of the sources, or of FMPy where it is installed; what misses another header is not judged from there on, for
that may be the header of a target.
"""

import importlib.util
import posixpath
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.description import Description
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.isolation.programs import run_program
from orchestrator.shared.isolation.surroundings import environment, system_folders
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.machine_code import local_compiler
from orchestrator.shared.scratch import Scratch

declare("""
[sources]
build.compiles | W | 2.3 | 2.5.1.3 | a compiler takes the sources | mend them; hosts without a binary for their platform compile them
""")  # noqa: E501

_LIMITS = Limits(time=20.0, memory=MEBIBYTE << 9, output=MEBIBYTE, total=20.0)
_MOST = 40  # files
_LARGEST = 16 << 20
_FOLDERS = ("bin", "include", "lib", "lib32", "lib64", "libexec")
"""What a compiler is made of, beside and above its own folder."""
_NOT_JUDGED = ("No such file", "Permission denied")
"""Said of a header that is not here: it may be that of a target."""
_LONGEST = 200  # letters of a message
_LANGUAGES = ("C", "C90", "C99", "C11", "C17")


@dataclass(frozen=True)
class SourceSet:
    """Files that are compiled in the same way."""

    files: tuple[str, ...]  # C files, relative to sources/
    words: tuple[str, ...]  # options of the compiler


def check_sources(d: Description, files: FmuFiles, walls: bool = True) -> tuple[list[Finding], str]:
    """Let a compiler read the sources. Return the findings, and why they are not judged, or nothing.

    Args:
        walls: whether the compiler must be kept from files that are neither its own nor of the FMU.
    """
    sets = [s for s in _sets(d, files) if s.files]
    compiler = local_compiler()
    if not sets:
        return [], "the FMU brings no sources in C"
    if compiler is None:
        return [], "there is no compiler"
    if walls and not support().landlock:
        return [], "this system cannot keep a compiler from files of the user, which sources may include"
    with Scratch("sources") as scratch:
        for path in (n for n in files.names() if n.startswith("sources/")):
            target = scratch.path / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(files.read(path, _LARGEST))
        for group in sets:
            done = _compile(compiler, scratch.path / "sources", group, walls)
            if done is None:
                return [], "the compiler reads them for too long"
            if done:
                text = f"a compiler must take the sources, but does not: {done}"
                return [Finding("build.compiles", "sources", text)], ""
    return [], ""


def _sets(d: Description, files: FmuFiles) -> Iterator[SourceSet]:
    """The files in C and their options, as the description or the build description has them."""
    names = set(files.names())
    if d.dialect.version == "2.0":
        listed = {e.get("name", "") for i in d.interfaces for e in i.element.findall("SourceFiles/File")}
        yield SourceSet(tuple(sorted(n for n in listed if n.endswith(".c") and f"sources/{n}" in names)), ())
        return
    path = "sources/buildDescription.xml"
    if path not in names:
        return
    try:
        root = etree.fromstring(files.read(path, 1 << 20), etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError:
        return
    identifiers = {i.identifier for i in d.interfaces}
    for build in root.findall("BuildConfiguration"):
        if build.get("platform") or build.get("modelIdentifier") not in identifiers:
            continue
        for group in build.findall("SourceFileSet"):
            if group.get("language", "C99") not in _LANGUAGES:
                continue
            chosen = [e.get("name", "") for e in group.findall("SourceFile")]
            macros = [(e.get("name", ""), e.get("value")) for e in group.findall("PreprocessorDefinition")]
            words = [f"-D{name}" if value is None else f"-D{name}={value}" for name, value in macros]
            words += [f"-I{posixpath.normpath(e.get('name', '.'))}" for e in group.findall("IncludeDirectory")]
            yield SourceSet(tuple(n for n in chosen if posixpath.normpath(f"sources/{n}") in names), tuple(words))


def _compile(compiler: str, folder: Path, group: SourceSet, walls: bool) -> str | None:
    """What a compiler says against sources; empty where it takes or cannot judge them, None where it does not end."""
    found = importlib.util.find_spec("fmpy")
    headers = [Path(found.origin).parent / "c-code"] if found is not None and found.origin else []
    names = [f"./{posixpath.normpath(name)}" for name in group.files[:_MOST]]
    command = [compiler, "-fsyntax-only", "-w", "-I.", *group.words, *(f"-I{path}" for path in headers), *names]
    home = Path(compiler).resolve().parents[1]
    read = [*system_folders(), Path(compiler).resolve().parent, *(home / name for name in _FOLDERS), *headers]
    read += [Path("/usr") / name for name in _FOLDERS] + [Path("/usr/local/include")]
    own = environment(folder, walls) | {"LC_ALL": "C"}
    try:
        done = run_program(command, folder, read, own, _LIMITS, walls)
    except OSError:
        return ""
    lines = [] if done is None or done[0] == 0 else [line for line in done[1].splitlines() if "error:" in line]
    errors = [line for line in lines if not any(word in line for word in _NOT_JUDGED)]
    return None if done is None else errors[0].strip()[:_LONGEST] if errors else ""
