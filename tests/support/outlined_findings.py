"""What the checker says of the broken FMUs of the tests, as it stands in ``tests/checking/outlines/``.

After a change that is meant ``python -m tests.support.outlined_findings`` writes the outlines anew: read what differs.
"""

import re
import tempfile
from pathlib import Path

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import check_fmu
from orchestrator.checking.findings import FmuFindings
from tests.support.broken_ball3 import behavioural
from tests.support.broken_ball3_xml import static
from tests.support.broken_fmus import corpus

FOLDER = Path(__file__).resolve().parents[1] / "checking" / "outlines"


def outline_of(report: FmuFindings) -> list[str]:
    """Rule, place and message of each finding, without what the machine's loader says and without measured numbers."""
    found = [f"{f.rule} | {f.path} | {f.message}" for f in report.findings if f.severity != "info"]
    found = [
        " ".join(re.sub(r"(the library must load, but:).*", r"\1 ...", line, flags=re.DOTALL).split()) for line in found
    ]
    found = [re.sub(r"(unpacked, but have) \d+", r"\1 ...", line) for line in found]  # with what the compiler made
    return [re.sub(r"-?\d[\d.e+-]*", "#", line) if report.executed else line for line in found]


def outlines(version: str) -> dict[str, list[str]]:
    """The outline of each broken FMU, by its name."""
    entries = re.findall(r"^(\S.*)\n((?: {4}.*\n)*)", (FOLDER / f"fmi{version}.txt").read_text("utf-8"), re.MULTILINE)
    return {name: [line.strip() for line in lines.splitlines()] for name, lines in entries}


def probes_for(lines: list[str]) -> tuple[str, ...]:
    """The probes that make the findings of an outline, and those whose runs they compare with."""
    parts = [line.split(" | ")[:2] for line in lines]  # without a place the message comes second
    places = [re.fullmatch(r"\((?:\w+, )?([a-z ]+)\)", path) for _, path in parts]
    return _with_runs({RULES[rule].stage for rule, _ in parts} | {place[1] for place in places if place})


def probes_of(rule: str) -> tuple[str, ...]:
    """The probe that finds what a rule says, and those whose runs it compares with."""
    return _with_runs({RULES[rule].stage})


def _with_runs(probes: set[str]) -> tuple[str, ...]:
    needed = sorted(probes - {"load", "life cycle"})
    return ("life cycle", "inputs", *needed) if needed else ("life cycle",)


def main() -> None:
    """Write both outlines."""
    FOLDER.mkdir(exist_ok=True)
    for version, mutants in (("2", corpus()), ("3", [*static(), *behavioural()])):
        lines = []
        for mutant in mutants:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "broken.fmu"
                mutant.make(path)
                lines += [mutant.name, *(f"    {line}" for line in outline_of(check_fmu(path, mutant.options)))]
        (FOLDER / f"fmi{version}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
