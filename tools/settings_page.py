"""Write ``docs/settings.md``: every setting of every workflow, with its default and its reason.

python -m tools.settings_page
"""

from pathlib import Path

from orchestrator.diagnosis.selection.grading import GRADE_RULES
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.estimation.settings import EstimationSettings
from orchestrator.paired.settings import MapSettings
from orchestrator.shared.settings import Settings, describe_settings
from tools import refuse_arguments

PAGE = Path(__file__).resolve().parents[1] / "docs" / "settings.md"
WORKFLOWS: tuple[tuple[str, str, type[Settings]], ...] = (
    ("Diagnosis", "diagnose", DiagnosisSettings),
    ("Estimation", "estimate", EstimationSettings),
    ("Calibration", "sweep", MapSettings),
)
HEAD = """# Settings

Every threshold of a workflow is a setting. A TOML file changes those that it names, by group; the rest keeps its
default (those of a calibration have no groups):

```toml
[selection]
least_gain = 0.02

[grades]
likely_share = 0.05
```

    python -m orchestrator diagnose DATA.csv --settings FILE.toml
    python -m orchestrator sweep --settings FILE.toml

From Python, `settings=` takes the same object. The result file holds all settings that were used, under `settings`.
A name that does not exist, or a value out of its bounds, is refused. This page is written by
`python -m tools.settings_page`.
"""


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    for title, command, kind in WORKFLOWS:
        rows = [f"| `{name}` | {_shown(default)} | {why} |" for name, default, why in describe_settings(kind)]
        parts.append(
            "\n".join([f"\n## {title} (`{command}`)\n", "| setting | default | meaning |", "|---|---|---|", *rows, ""])
        )
    return "".join([*parts, _rules()])


def _rules() -> str:
    """Return the table of the rules that lower a grade."""
    cells = [
        (rule.name, rule.highest.word, rule.statistic, f"`{rule.setting}`" if rule.setting else "", rule.reason)
        for rule in GRADE_RULES
    ]
    rows = [f"| {' | '.join(row)} |" for row in cells]
    head = "| rule | grade where it does not hold | statistic | threshold | reason |\n|---|---|---|---|---|\n"
    text = "An effect is certain unless a rule lowers it. A threshold that every effect reaches switches its rule off."
    return "\n## Rules\n\n" + text + "\n\n" + head + "\n".join(rows) + "\n"


def _shown(default: object) -> str:
    if isinstance(default, tuple):
        return ", ".join(_shown(value) for value in default)
    return f"{default:g}" if isinstance(default, float) else str(default)


if __name__ == "__main__":
    refuse_arguments(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
