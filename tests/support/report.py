"""A report with one of everything."""

import math
import random
from pathlib import Path

from orchestrator.reporting import Facts, Findings, Plot, Remark, Report, ReportTable, Series, Span, TableColumn, Text


def example(directory: Path) -> Report:
    """Return the report; ``directory`` gets a small file to download."""
    dice = random.Random(1)
    (directory / "data.csv").write_text("time,u\n0.0,1.5\n")
    time = [i / 100 for i in range(2001)]
    sizes = [dice.uniform(0.002, 0.1) for _ in range(100)]
    estimate = Series(
        "estimate",
        sizes,
        [v * (1.0 + dice.gauss(0.0, 0.05)) for v in sizes],
        "points",
        [v * 0.9 for v in sizes],
        [v * 1.1 for v in sizes],
        [f"case {i}" for i in range(100)],
    )
    curves = (
        Series("with backlash", time, [math.sin(t) * math.exp(-t / 9.0) for t in time]),
        Series("without", time, [math.sin(t + 0.1) if not 5.0 < t < 6.0 else None for t in time]),
        Series("held", time[::50], [round(math.sin(t), 1) for t in time[::50]], "steps"),
    )
    scores = Series("score", [0, 1, 2, 3], [5.0, 3.0, 0.5, -1.0], "points")
    rows = tuple((i, 10.0 ** dice.uniform(-3, 2), "error" if i % 9 == 0 else "done", i % 2 == 0) for i in range(60))
    return Report(
        "Example",
        "100 sizes were estimated; 2 cases failed.",
        (
            Facts("Overview", (("cases", 100), ("mean squared error", 1.234567e-9), ("missing", None))),
            ReportTable(
                "Cases",
                (TableColumn("case"), TableColumn("alpha", "rad"), TableColumn("status"), TableColumn("inside")),
                rows,
                "A note.",
            ),
            Plot("Estimated against actual", "actual [rad]", "estimated [rad]", (estimate,), diagonal=True),
            Plot("Load position", "time [s]", "position [rad]", curves, (Span(3.0, 4.0, "out of contact"),)),
            Plot(
                "Errors",
                "alpha [rad]",
                "error [%]",
                (Series("error", [0.001, 0.01, 0.1, 1.0], [1e-5, 0.0, 0.1, 1.0], "points"),),
                log_x=True,
                log_y=True,
            ),
            Plot("Scores", "effect", "score", (scores,), categories=("backlash", "friction", "delay", "ripple")),
            Findings(
                "Problems",
                (
                    Remark("error", "modelDescription.xml", "A unit must be defined, but is not.", "Define it."),
                    Remark("warning", "x", "A warning."),
                    Remark("info", "y", "A remark."),
                ),
            ),
            Text("Notes", ("One paragraph.",)),
        ),
        badge=("bad", "2 cases failed"),
        origin=(("command", "sweep"), ("seed", 0)),
        downloads=(directory / "data.csv",),
    )
