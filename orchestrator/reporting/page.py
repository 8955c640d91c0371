"""A report as one HTML page that needs nothing but a browser."""

import base64
import json
import mimetypes
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from orchestrator.reporting.model import (
    POINT_LIMIT,
    Bars,
    Cell,
    Facts,
    Findings,
    Numbers,
    Picture,
    Plot,
    Report,
    ReportTable,
    Section,
    Series,
    Text,
)
from orchestrator.reporting.numbers import in_words, thin_series

EMBED_LIMIT = 1_000_000
LONG_TEXT = 40
SCRIPTS = ("scale.js", "svg.js", "plot.js", "page.js")
_KINDS = {
    Text: "text",
    Facts: "facts",
    ReportTable: "table",
    Plot: "plot",
    Findings: "findings",
    Bars: "bars",
    Picture: "picture",
}


def render(report: Report) -> str:
    """Return the page. It depends on the report and the files named in ``downloads`` only, never on the date."""
    return (
        _environment()
        .get_template("page.html")
        .render(
            report=report,
            downloads=[_download(path) for path in report.downloads],
            style=Markup(_asset("page.css")),
            script=Markup("\n".join(_asset(name) for name in SCRIPTS)),
        )
    )


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("orchestrator.reporting"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "words": in_words,
        "plot_data": _plot_data,
        "sort_key": _sort_key,
        "cell_class": _cell_class,
        "embedded": _embed,
    }
    environment.globals["kind"] = _kind
    return environment


def _asset(name: str) -> str:
    return files("orchestrator.reporting").joinpath("templates", name).read_text(encoding="utf-8")


def _kind(section: Section) -> str:
    return _KINDS[type(section)]


def _sort_key(value: Cell) -> str:
    """Return what the browser sorts by: a number at full precision, or the text."""
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, (int, float)) else value


def _cell_class(value: Cell) -> Markup:
    """Return the class attribute of a table's cell: numbers are aligned, sentences get room."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return Markup(' class="number"')
    return Markup(' class="long"') if isinstance(value, str) and len(value) > LONG_TEXT else Markup("")


def _plot_data(plot: Plot) -> Markup:
    """Return a plot as JSON that is safe inside a script element."""
    data = {
        "title": plot.title,
        "xLabel": plot.x_label,
        "yLabel": plot.y_label,
        "logX": plot.log_x,
        "logY": plot.log_y,
        "diagonal": plot.diagonal,
        "categories": list(plot.categories),
        "spans": [{"start": s.start, "end": s.end, "name": s.name} for s in plot.spans],
        "series": [_series_data(thin_series(s, POINT_LIMIT)) for s in plot.series],
    }
    return in_script(data)


def _series_data(series: Series) -> dict[str, object]:
    data: dict[str, object] = {"name": series.name, "kind": series.kind}
    data |= {"x": _round(series.x), "y": _round(series.y)}
    if series.low is not None and series.high is not None:
        data |= {"low": _round(series.low), "high": _round(series.high)}
    if series.labels is not None:
        data["labels"] = list(series.labels)
    return data


def _round(values: Numbers) -> list[float | None]:
    """Return numbers to ten significant digits: half the size of the page, and more than any zoom shows."""
    return [None if value is None else float(f"{value:.10g}") for value in values]


def _download(path: Path) -> dict[str, str]:
    length = path.stat().st_size
    size = f"{length / 1000:.1f} kB" if length < 1_000_000 else f"{length / 1e6:.1f} MB"
    if length > EMBED_LIMIT:
        return {"name": path.name, "size": f"{size}, beside this page", "href": path.name}
    return {"name": path.name, "size": size, "href": _embed(path)}


def in_script(data: Any) -> Markup:
    """Write data as JSON. Return text that is safe inside a script element."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("&", "\\u0026"))


def _embed(path: Path) -> str:
    """Return a file as an address that holds all of it."""
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
