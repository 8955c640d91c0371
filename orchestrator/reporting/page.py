"""A report as one HTML page that needs nothing but a browser."""

import base64
import mimetypes
from functools import cache
from pathlib import Path

import jinja2
from markupsafe import Markup

from orchestrator.reporting.model import Fold, Report
from orchestrator.reporting.plots import asset, in_script, plot_data, plot_script, plot_style, rows_of_a_curve
from orchestrator.reporting.quantities import angle_attributes, mark_prose, mark_unit
from orchestrator.shared.numbers import cell_text
from orchestrator.shared.results.fields import Cell

EMBED_LIMIT = 1_000_000
LONG_TEXT = 40


def render(report: Report, rows: int | None = None) -> str:
    """Return the page, with at most ``rows`` rows of a curve (default: as many as a page has room for).

    It depends on the report and the files named in ``downloads`` only, never on the date.
    """
    page = _environment().get_template("page.html")
    return page.render(
        report=report,
        rows=rows or rows_of_a_curve(report.plots()),
        folds=any(isinstance(section, Fold) for section in report.sections),
        downloads=[_download(path) for path in report.downloads],
        style=Markup(plot_style()),
        script=Markup(f"{plot_script()}\n{asset('page.js')}"),
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
        "words": cell_text,
        "plot_data": lambda plot, rows: in_script(plot_data(plot, rows)),
        "prose": mark_prose,
        "unit_marked": mark_unit,
        "angle_attributes": angle_attributes,
        "sort_key": _sort_key,
        "cell_class": _cell_class,
    }
    environment.globals["kind"] = lambda section: type(section).__name__.removeprefix("Report").lower()  # its template
    return environment


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


def _download(path: Path) -> dict[str, str]:
    length = path.stat().st_size
    size = f"{length / 1000:.1f} kB" if length < 1_000_000 else f"{length / 1e6:.1f} MB"
    if length > EMBED_LIMIT:
        return {"name": path.name, "size": f"{size}, beside this page", "href": path.name}
    return {"name": path.name, "size": size, "href": _embed(path)}


def _embed(path: Path) -> str:
    """Return a file as an address that holds all of it."""
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"
