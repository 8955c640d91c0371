"""Sources that an FMU brings: a compiler reads them, with the macros and folders of the build description.

Nothing is linked and nothing of it is run. Headers of FMI are those of the sources, or of FMPy where it is installed;
what misses another header is not judged, for it may be that of a target.
"""

import importlib.util
import os
import posixpath
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.description import Description
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare
from orchestrator.shared.machine_code import compiler_environment, local_compiler
from orchestrator.shared.scratch import Scratch

declare("""
[sources]
build.compiles | W | 2.3 | 2.5.1.3 | a compiler takes the sources | mend them; hosts without a binary for their platform compile them
""")  # noqa: E501

_SECONDS = 20.0
_MOST = 40  # files
_LARGEST = 16 << 20
_MEMORY = 1 << 30
_LONGEST = 200  # letters of a message
_LANGUAGES = ("C", "C90", "C99", "C11", "C17")


@dataclass(frozen=True)
class SourceSet:
    """Files that are compiled in the same way.

    Attributes:
        files: C files, relative to sources/.
        words: options of the compiler.
    """

    files: tuple[str, ...]
    words: tuple[str, ...]


def check_sources(d: Description, files: FmuFiles) -> tuple[list[Finding], str]:
    """Let a compiler read the sources. Return the findings, and why they are not judged, or nothing."""
    sets = list(_sets(d, files))
    compiler = local_compiler()
    if not any(s.files for s in sets):
        return [], "the FMU brings no sources in C"
    if compiler is None:
        return [], "there is no compiler"
    with Scratch("sources") as scratch:
        for path in (n for n in files.names() if n.startswith("sources/")):
            target = scratch.path / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(files.read(path, _LARGEST))
        chosen = [(name, one.words) for one in sets for name in one.files]
        for name, words in chosen[:_MOST]:
            message = _compile(compiler, scratch.path / "sources", name, words)
            if message:
                text = f"a compiler must take the sources, but does not take `{name}`: {message}"
                return [Finding("build.compiles", f"sources/{name}", text)], ""
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


def _limit() -> None:
    """Bound the memory of a compiler."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))


def _compile(compiler: str, folder: Path, name: str, words: tuple[str, ...]) -> str:
    """What a compiler says against a file; empty where it takes it or cannot judge it."""
    found = importlib.util.find_spec("fmpy")
    headers = [f"-I{Path(found.origin).parent / 'c-code'}"] if found is not None and found.origin else []
    command = [compiler, "-fsyntax-only", "-w", "-I.", *words, *headers, f"./{posixpath.normpath(name)}"]
    try:
        run = subprocess.run(
            command, cwd=folder, capture_output=True, timeout=_SECONDS, check=False, stdin=subprocess.DEVNULL,
            preexec_fn=_limit if os.name == "posix" else None,
            env=compiler_environment(folder) | {"LC_ALL": "C"},
        )  # fmt: skip
    except (subprocess.TimeoutExpired, OSError):
        return ""
    lines = run.stderr.decode("utf-8", "replace").splitlines()
    errors = [line for line in lines if "error:" in line]
    missing = any("No such file" in line for line in errors)
    return "" if run.returncode == 0 or missing or not errors else errors[0].strip()[:_LONGEST]
