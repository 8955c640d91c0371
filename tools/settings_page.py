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

Every threshold of a workflow is a setting. A TOML file sets the settings that it names, by group; all others keep
their defaults. The settings of a calibration have no groups:

```toml
[selection]
least_gain = 0.02

[grades]
likely_share = 0.05
```

    python -m orchestrator diagnose DATA.csv --settings FILE.toml
    python -m orchestrator sweep --settings FILE.toml

In Python, pass the same object as `settings=`. The result file contains all settings of the run under `settings`.
Unknown names and values out of bounds are refused. `python -m tools.settings_page` writes this page.
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
    text = "An effect is certain unless a rule lowers its grade. A threshold that all effects reach disables its rule."
    return "\n## Rules\n\n" + text + "\n\n" + head + "\n".join(rows) + "\n"


def _shown(default: object) -> str:
    if isinstance(default, tuple):
        return ", ".join(_shown(value) for value in default)
    return f"{default:g}" if isinstance(default, float) else str(default)


if __name__ == "__main__":
    refuse_arguments(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
