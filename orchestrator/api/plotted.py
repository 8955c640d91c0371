"""Results with plots: those of their page, which a notebook shows too."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.api.shown import Result
from orchestrator.errors import ScenarioError
from orchestrator.shared.output import write_result
from orchestrator.shared.scratch import Scratch

if TYPE_CHECKING:
    from orchestrator.reporting import Report

ROWS = 50_000
"""Rows of a curve that a notebook keeps: half a megabyte of its file. The page of ``save`` has all."""
PLOT_HEIGHT, HEAD_HEIGHT, MOST_HEIGHT = 500, 130, 1150
"""Pixels of a plot, of the head, and of the frame at most, which scrolls."""


@dataclass(frozen=True)
class Figures:
    """The plots of a result: a notebook shows them, to be zoomed and read as on its page."""

    report: Report  # a page of the plots alone

    @property
    def titles(self) -> tuple[str, ...]:
        """What the plots show, in their order."""
        return tuple(section.title for section in self.report.sections)

    def __repr__(self) -> str:
        return f"Figures: {', '.join(self.titles)}"

    def _repr_html_(self) -> str:
        from orchestrator.reporting import render

        if not self.titles:
            return ""
        height = min(HEAD_HEIGHT + PLOT_HEIGHT * len(self.titles), MOST_HEIGHT)
        page = escape(render(self.report, ROWS))
        return (
            f'<iframe title="{escape(self.report.title)}" srcdoc="{page}" width="100%" height="{height}" '
            'style="border:0" sandbox="allow-scripts"></iframe>'
        )


class PlottedResult(Result):
    """Base of results whose page has plots."""

    def plot(self, path: Path | str | None = None) -> Figures:
        """Return the plots, and draw them where a path is given. ``path``: a PNG, SVG or PDF file; None: no file.

        Returns:
            The plots of the page, which a notebook shows.

        Raises:
            ScenarioError: a path is given, and the result has no plots.
        """
        plots = self.figures.report.plots()
        if path is not None:
            if not plots:
                raise ScenarioError(f"`path` must be absent, but is {path}: this result has no plots", "path")
            from orchestrator.reporting.pictures import draw_plots  # matplotlib, which takes its time to import

            draw_plots(Path(path), plots)
        return self.figures

    @cached_property
    def figures(self) -> Figures:
        """The plots of the page."""
        from orchestrator.reporting import Report, report_from_directory

        with Scratch("figures") as scratch:
            folder = scratch.path
            self.write_data(folder)
            write_result(folder, self.command, self.arguments, self.seed, self.results(folder))
            page = report_from_directory(folder, self.command)
        return Figures(Report(page.title, page.summary, page.plots(), page.badge, angle_unit=page.angle_unit))

    def _repr_html_(self) -> str:
        return f"{super()._repr_html_()}\n{self.figures._repr_html_()}"
