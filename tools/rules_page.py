"""Write ``docs/rules.md``: every rule of the checker.

python -m tools.rules_page
"""

from pathlib import Path

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.rules import VERSIONS, Rule, Version
from tools import refuse_arguments

PAGE = Path(__file__).resolve().parents[1] / "docs" / "rules.md"
HEAD = """# Rules of the checker

[Checking FMUs](check.md) says how rules are selected and what runs them.
The sections are those of the texts of FMI 2.0.4 and 3.0.2; "own" is a rule that the standard does not have, "-" is one
that does not apply. This page is written by `python -m tools.rules_page`.

| rule | severity | FMI 2.0 | FMI 3.0 | what must hold | what to do |
|---|---|---|---|---|---|
"""


def page() -> str:
    """Return the page."""
    rows = [
        f"| `{name}` | {r.severity} | {_place(r, '2.0')} | {_place(r, '3.0')} | {r.expects} | {r.advice} |\n"
        for name, r in RULES.items()
    ]
    return HEAD + "".join(rows)


def _place(rule: Rule, version: Version) -> str:
    assert version in VERSIONS
    if version not in rule.versions:
        return "-"
    section, link = rule.anchor[version], rule.link(version)
    if not section:
        return "own"
    return f"[{section}]({link})" if "#" in link else section


if __name__ == "__main__":
    refuse_arguments(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
