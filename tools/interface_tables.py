"""Write the interface tables of ``fmus/README.md``, made from the FMUs' own model descriptions.

python -m tools.interface_tables
"""

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestrator.building.archive import read_archive
from orchestrator.building.build import ROOT, ensure_built
from tools import refuse_arguments

PAGE = ROOT / "fmus" / "README.md"
BEGIN = "<!-- interfaces: made by `python -m tools.interface_tables` -->\n"
END = "<!-- end of interfaces -->\n"
SECTIONS = (("Inputs", "input"), ("Outputs", "output"), ("Parameters", "parameter"))


def tables(fmus: dict[str, Path]) -> str:
    """Return the sections of all FMUs as Markdown."""
    return "\n".join(_section(read_archive(path)["modelDescription.xml"]) for path in fmus.values())


def with_tables(page: str, text: str) -> str:
    """Return the page with the text between its two marks replaced."""
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    return f"{before}{BEGIN}\n{text}\n{END}{after}"


def _section(description: bytes) -> str:
    root = ElementTree.fromstring(description)
    parts = [f"## {root.attrib['modelName']}\n", f"{root.attrib['description']}.\n"]
    for heading, causality in SECTIONS:
        variables = [v for v in root.iter("ScalarVariable") if v.attrib["causality"] == causality]
        if variables:
            parts.append(f"**{heading}**\n")
            parts.append("| name | unit | start | range | meaning |\n|---|---|---|---|---|")
            parts[-1] += "".join(f"\n{row}" for row in _rows(variables)) + "\n"
    return "\n".join(parts)


def _rows(variables: list[Element]) -> Iterator[str]:
    """Yield one row for each variable; the elements of a matrix share one."""
    groups: dict[str, list[Element]] = {}
    for variable in variables:
        name = variable.attrib["name"]
        text = variable.attrib["description"]
        key = re.sub(r"\[.*\]", f"[{text}]", name)
        groups.setdefault(key, []).append(variable)
    for members in groups.values():
        first, last = members[0], members[-1]
        kind = first[0].attrib
        units = {v[0].get("unit", "-") for v in members}
        starts = {v[0].get("start", "") for v in members}
        name = first.attrib["name"]
        if len(members) > 1:
            name = f"{name} … {last.attrib['name']}"
        unit = units.pop() if len(units) == 1 else "by element"
        start = starts.pop() if len(starts) == 1 else "default design"
        yield f"| `{name}` | {unit} | {_short(start)} | {_range(kind)} | {first.attrib['description']} |"


def _short(start: str) -> str:
    return f"{float(start):g}" if re.fullmatch(r"-?[0-9.e+-]+", start) else start


def _range(kind: dict[str, str]) -> str:
    low, high = kind.get("min"), kind.get("max")
    if low is None and high is None:
        return ""
    return f"{_short(low or '')} … {_short(high or '')}"


if __name__ == "__main__":
    refuse_arguments(__doc__)
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), tables(ensure_built())), encoding="utf-8")
