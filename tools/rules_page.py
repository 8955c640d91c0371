"""Write the table of rules in ``docs/check.md``.

python -m tools.rules_page
"""

from pathlib import Path

from orchestrator.checking.rules import RULES, VERSIONS, Rule, Version

PAGE = Path(__file__).resolve().parents[1] / "docs" / "check.md"
HEADING = "## Rules\n"
HEAD = """
The sections are those of the texts of FMI 2.0.4 and 3.0.2; "own" is a rule that the standard does not have, "-" is one
that does not apply. This table is written by `python -m tools.rules_page`.

| rule | severity | FMI 2.0 | FMI 3.0 | what must hold | what to do |
|---|---|---|---|---|---|
"""


def page(text: str) -> str:
    """Return the page with its table of rules made anew.

    Args:
        text: of the page; the table is all that follows the heading "Rules".
    """
    rows = [
        f"| `{name}` | {r.severity} | {_place(r, '2.0')} | {_place(r, '3.0')} | {r.expects} | {r.advice} |\n"
        for name, r in RULES.items()
    ]
    return text[: text.index(HEADING) + len(HEADING)] + HEAD + "".join(rows)


def _place(rule: Rule, version: Version) -> str:
    assert version in VERSIONS
    if version not in rule.versions:
        return "-"
    section, link = rule.anchor[version], rule.link(version)
    if not section:
        return "own"
    return f"[{section}]({link})" if "#" in link else section


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
