"""Scripts of findings have the form of findings/README.md; they run outside software, so they are not run here."""

import re
from pathlib import Path

FINDINGS = Path(__file__).resolve().parents[1] / "findings"


def faults(text):
    """What a script lacks of the form."""
    head = [line for line in text.splitlines()[1:] if line.startswith("#")]
    yield from (part for part in ("Guess", "What happens", "Version") if not any(f"# {part}:" in line for line in head))
    yield from (line for line in ("set -euo pipefail", "mktemp -d", "trap ") if line not in text)
    if re.search(r"pip install (?!.*==)", text):
        yield "packages without a version"
    if re.search(r"\b(orchestrator|pyfmu_sources|backlash)\b", text):
        yield "runs this project"


def example():
    return re.search(r"```bash\n(.+?)```", (FINDINGS / "README.md").read_text(encoding="utf-8"), re.DOTALL)[1]


def test_the_example_has_the_form_and_what_lacks_is_seen():
    text = example()
    assert not list(faults(text))
    assert list(faults(text.replace("# Guess:", "# ").replace("==1.2.3", ""))) == [
        "Guess",
        "packages without a version",
    ]
    assert list(faults(text.replace("import package", "import orchestrator"))) == ["runs this project"]


def test_each_script_has_the_form():
    assert not {path.name: found for path in FINDINGS.glob("*.sh") if (found := list(faults(path.read_text("utf-8"))))}
