"""The documentation, icon and licence that an FMU carries."""

import html
from collections.abc import Sequence
from xml.etree.ElementTree import Element

from orchestrator.building.reference_files import DATA
from orchestrator.building.sources import Recipe

STYLE = """body { font: 15px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { border: 1px solid #bbb; padding: .2em .6em; text-align: left; }
td.number { text-align: right; font-variant-numeric: tabular-nums; } .equation { margin-left: 2em; }"""
PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{name}</title><style>
{style}
</style></head>
<body>
<h1>{name}</h1>
<p>{title}. FMI {fmi}.0 for {interfaces}.</p>
{equations}
{tables}
<h2>Running it</h2>
<p>{running}</p>
<p>Refused calls change nothing: values out of range and steps that cannot be taken return fmi{fmi}Discard, calls that
the standard forbids return fmi{fmi}Error, both with a message.</p>
<h2>Licence</h2>
<p>MIT; see <a href="licenses/license.txt">licenses/license.txt</a>.{license}</p>
</body>
</html>
"""
RUNNING_PYTHON = """The FMU needs a Python 3.9 or later with nothing but its standard library. In a Python host it uses
the host's. In any other host on Linux it opens the libpython that it was built with, else the system's libpython3; the
environment variable FMU_LIBPYTHON names another one. On Windows a python3.dll must be on the path."""
RUNNING_NATIVE = """The FMU needs nothing but the C library. Its sources are in <code>sources/</code>, translated from
the Python of the project; binaries: {platforms}."""
PYTHONFMU_LICENSE = """ PythonFMU, which connects Python and C, has its own in
<a href="licenses/PythonFMU.txt">licenses/PythonFMU.txt</a>."""


def documentation(
    recipe: Recipe, description: Element, platforms: Sequence[str] = (), fmi: int = 2
) -> dict[str, bytes]:
    """Return members of the archive: a page, the licence and the icon.

    ``description``: its model description in FMI 2.0; ``fmi``: version of FMI that the FMU has, 2 or 3.
    """
    fragments = [f"{recipe.class_name}.html"]
    if any(v.attrib["name"] == "sample_time" for v in description.iter("ScalarVariable")):
        fragments.append("sampled.html")
    paths = [DATA / name for name in fragments]
    page = PAGE.format(
        name=html.escape(description.attrib["modelName"]),
        title=html.escape(description.attrib["description"]),
        style=STYLE,
        fmi=fmi,
        interfaces="co-simulation" if description.find("ModelExchange") is None else "co-simulation and model exchange",
        equations="\n".join(path.read_text(encoding="utf-8").strip() for path in paths if path.exists()),
        running=RUNNING_NATIVE.format(platforms=", ".join(platforms)) if platforms else RUNNING_PYTHON,
        license="" if platforms else PYTHONFMU_LICENSE,
        tables="\n".join(_table(description, *section) for section in _SECTIONS),
    )
    icon = "model.png" if fmi == 2 else "terminalsAndIcons/icon.png"
    files = {"documentation/index.html": page.encode(), icon: (DATA / "model.png").read_bytes()}
    return files | {"documentation/licenses/license.txt": (DATA / "license.txt").read_bytes()}


_SECTIONS = (("Inputs", "input"), ("Outputs", "output"), ("Parameters", "parameter"))


def _table(description: Element, heading: str, causality: str) -> str:
    rows = [_row(v) for v in description.iter("ScalarVariable") if v.attrib["causality"] == causality]
    if not rows:
        return ""
    head = "<tr><th>name</th><th>unit</th><th>start</th><th>minimum</th><th>maximum</th><th>meaning</th></tr>"
    return "\n".join([f"<h2>{heading}</h2>", "<table>", head, *rows, "</table>"])


def _row(variable: Element) -> str:
    kind = variable[0].attrib
    texts = (f"{float(kind[key]):.6g}" if key in kind else "" for key in ("start", "min", "max"))
    numbers = "".join(f'<td class="number">{text}</td>' for text in texts)
    name, text = html.escape(variable.attrib["name"]), html.escape(variable.attrib["description"])
    return f"<tr><td><code>{name}</code></td><td>{kind.get('unit', '')}</td>{numbers}<td>{text}</td></tr>"
