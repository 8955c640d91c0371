"""Other files of an FMU: documentation, icon, and the related files of the layered standard FMI-LS-REF."""

import csv
import io
import math
import posixpath
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from orchestrator.checking import xml_reading
from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.companions import check_companions, check_icon
from orchestrator.checking.description import DescribedVariable, Description
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules import declare

declare("""
[files]
file.documentation | W | 2.3 | 2.5.1.1 | documentation has its entry page | name the first page index.html
file.license | W | - | 2.5.1.1 | a folder of licenses has its entry | name it license.txt, license.html or license.spdx
file.external | W | - | 2.5.3 | a tool that is needed is documented | add documentation/externalDependencies.txt
layered.manifest | W | 2.3 | 2.6 | a layered standard's manifest is complete and in its folder | correct the attributes or the folder
layered.role | W | 2.3 | * | roles are those of FMI-LS-REF | use "result", "experiment", …
layered.missing | W | 2.3 | * | related files exist | add the file, or remove the entry
layered.result | W | 2.3 | * | a reference result is a table of variables over time | write `time` and variable names as header, numbers below
""")  # noqa: E501

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"
_NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
_ROLE = re.compile(
    r"document|requirement|specification|model|parameter|system|testcase"
    r"|experiment(/(smoke-test|validation|uncertainty-analysis))?|result|method|rationale|report|request|delivery"
    r"|configuration|signature|serialized-state(/.*)?|meta-data|other"
)
_MAXIMUM_CSV = 64 << 20


@dataclass(frozen=True)
class ReferenceResult:
    """A reference result that is fit to be compared with."""

    path: str  # CSV file in the FMU
    names: tuple[str, ...]  # of the variables of the values after the time; an array's stands as often as it has values
    # rows of time and values, Boolean ones as 0 and 1; columns of texts are left out
    rows: tuple[tuple[float, ...], ...]


def check_files(d: Description, files: FmuFiles) -> Iterator[Finding]:
    """Findings about the documentation, the icon, and the further files of FMI 3.0."""
    names = set(files.names())
    if d.dialect.version == "3.0":
        yield from check_companions(d, files)
        yield from _documents(d, names)
    documents = any(re.fullmatch(r"documentation/(?!licenses/|diagrams?/).+", n) for n in names)
    entries = ("documentation/index.html", "documentation/_main.html")[: 2 if d.dialect.version == "2.0" else 1]
    if documents and not names & set(entries):
        message = f"documentation/ must have the entry {entries[0]}, but has not"
        yield Finding("file.documentation", "documentation", message)
    if "model.png" in names:
        yield from check_icon(files, "model.png")


def _documents(d: Description, names: set[str]) -> Iterator[Finding]:
    """FMI 3.0: entry pages of the folders of documentation."""
    licences = [n for n in names if n.startswith("documentation/licenses/")]
    if licences and not any(re.fullmatch(r"documentation/licenses/license\.(txt|html|spdx)", n) for n in licences):
        message = "documentation/licenses must have the entry license.txt, .html or .spdx, but has not"
        yield Finding("file.license", "documentation/licenses", message)
    if "documentation/diagram.svg" in names and "documentation/diagram.png" not in names:
        message = "a diagram in SVG must be there as PNG, too, but is not"
        yield Finding("file.documentation", "documentation/diagram.svg", message)
    external = {"documentation/externalDependencies.txt", "documentation/externalDependencies.html"}
    if any(i.flag("needsExecutionTool") for i in d.interfaces) and not external & names:
        message = "a tool that the FMU needs must be documented in documentation/externalDependencies.txt or .html"
        yield Finding("file.external", "documentation", f"{message}, but is not")


def check_layered(d: Description, files: FmuFiles) -> tuple[list[ReferenceResult], list[Finding]]:
    """The reference results of FMI-LS-REF that can be read, and findings on every manifest of a layered standard."""
    findings: list[Finding] = []
    results: list[ReferenceResult] = []
    names = set(files.names())
    for path in sorted(n for n in names if re.fullmatch(r"extra/[^/]+/fmi-ls-manifest\.xml", n)):
        root, problems = xml_reading.parse(files.read(path, xml_reading.MAXIMUM_BYTES), path)
        findings += problems
        if root is None:
            continue
        folder = path.split("/")[1]
        for attribute in ("fmi-ls-name", "fmi-ls-version", "fmi-ls-description"):
            if not root.get(_NAMESPACE + attribute):
                findings.append(Finding("layered.manifest", path, f"the manifest must have {attribute}, but has not"))
        name = root.get(_NAMESPACE + "fmi-ls-name")
        if name and name != folder:
            findings.append(Finding("layered.manifest", path, f"the folder must be called `{name}`, but is `{folder}`"))
        if path == MANIFEST:
            read, problems = _references(d, root, files, names)
            results += read
            findings += problems
    return results, findings


def _references(
    d: Description, root: "xml_reading.etree._Element", files: FmuFiles, names: set[str]
) -> tuple[list[ReferenceResult], list[Finding]]:
    findings: list[Finding] = []
    results: list[ReferenceResult] = []
    for related in root.findall("Related"):
        where = xml_reading.xpath(related, name=MANIFEST)
        source, role = related.get("source", ""), related.get("role", "")
        if not _ROLE.fullmatch(role):
            findings.append(Finding("layered.role", where, f"role must be one of the standard's, but is {role!r}"))
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", source):
            continue  # an absolute URI: nothing is fetched
        path = posixpath.normpath(posixpath.join(FOLDER, source))
        if path not in names:
            findings.append(Finding("layered.missing", where, f"a related file must be in the FMU, but {path} is not"))
        elif role == "result" and related.get("type") == "text/csv":
            try:
                results.append(_read_csv(path, files.read(path, _MAXIMUM_CSV), {v.name: v for v in d.variables}, d))
            except UnicodeDecodeError:
                findings.append(Finding("layered.result", path, "a reference result must be UTF-8, but is not"))
            except csv.Error:
                findings.append(Finding("layered.result", path, "a reference result must be a CSV table, but is none"))
            except ValueError as error:
                findings.append(Finding("layered.result", path, str(error)))
    return results, findings


def _read_csv(path: str, data: bytes, known: Mapping[str, DescribedVariable], d: Description) -> ReferenceResult:
    if len(data) > _MAXIMUM_CSV:
        raise ValueError(f"a reference result must have at most {_MAXIMUM_CSV} bytes, but has more")
    rows = [r for r in csv.reader(io.StringIO(data.decode("utf-8-sig"))) if r]
    if len(rows) < 3 or len(rows[0]) < 2:
        raise ValueError("a reference result must have a header, a column beside time, and two rows, but has not")
    header = [h.strip() for h in rows[0]]
    unknown = [h for h in header[1:] if h not in known]
    if unknown:
        raise ValueError(f"the columns must be variables of the FMU, but `{unknown[0]}` is none")
    if header[0] != "time" or len(set(header)) < len(header):
        raise ValueError("the first column must be `time` and no name may come twice, but it is not so")
    sizes = {h: d.size(known[h]) or 1 for h in header[1:] if known[h].kind not in ("String", "Binary")}
    values: list[tuple[float, ...]] = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            raise ValueError(f"line {number} must have {len(header)} values, but has {len(row)}")
        found = _numbers(row[0], 1, number)
        for name, cell in zip(header[1:], row[1:], strict=True):
            if name in sizes:
                found += _numbers(cell, sizes[name], number)
        values.append(found)
        if len(values) > 1 and values[-1][0] < values[-2][0]:
            raise ValueError(f"time must not decrease, but does in line {number}")
    names = tuple(name for name, size in sizes.items() for _ in range(size))
    return ReferenceResult(path, names, tuple(values))


def _numbers(cell: str, size: int, line: int) -> tuple[float, ...]:
    """The numbers of a cell: as many as the variable has values."""
    words = {"true": "1", "false": "0"}
    try:
        found = tuple(float(words.get(word, word)) for word in cell.split())
    except ValueError:
        raise ValueError(f"line {line} must have numbers only, but has not") from None
    if len(found) != size or not all(map(math.isfinite, found)):
        raise ValueError(f"line {line} must have {size} finite number{'s' * (size > 1)} in each cell, but has not")
    return found
