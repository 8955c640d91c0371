"""Runs other checkers on the FMUs of FMI 3.0 that are broken on purpose, and prints what each of them sees.

    python -m benchmarks.other_checkers
    python -m benchmarks.other_checkers --fmutool PROGRAM --vdmcheck VDMCheck3.sh

``check`` has caught an FMU when the rule that is meant is among its findings. Another checker has when it says anything
that it does not say of the FMUs that nothing is wrong with, whatever the words; numbers in them do not count. FMPy
comes with the project; fmutool (package fmu-manipulation-toolbox) and VDMCheck3 are run where they are named. VDMCheck3
ends with an error of its own at variables of type UInt64, so it gets UInt32 in their place.
"""

import argparse
import multiprocessing
import re
import subprocess
import sys
import tempfile
import zipfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from fmpy.validation import validate_fmu

from orchestrator.checking.check import check_fmu
from tests.support.ball3 import INTERFACES, XML, build_ball
from tests.support.broken_ball3 import Mutant, behavioural
from tests.support.broken_ball3_xml import static
from tests.support.c_fmu import write_fmu

CHECK = "check"
TIME_LIMIT = 120.0
_SAID: dict[object, list[str]] = {}
GROUPS = ("xml", "files", "CoSimulation", "ModelExchange", "ScheduledExecution", "flags")


def fmpy(path: Path, _: str) -> list[str]:
    """What FMPy complains of."""
    try:
        return [str(problem) for problem in validate_fmu(str(path))]
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]


def fmutool(path: Path, program: str) -> list[str]:
    """What fmutool complains of."""
    return _lines([program, "-input", str(path), "-check"], re.compile("^INFO .*compliant|^INFO .*No semantic|READING"))


def vdmcheck(path: Path, program: str) -> list[str]:
    """What VDMCheck3 complains of; it reads nothing but XML, so equal XML is read once."""
    other = path.with_suffix(".vdm.fmu")
    key: object = path.read_bytes()
    try:
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        files[XML] = files[XML].replace(b"<UInt64", b"<UInt32")
        write_fmu(other, files)
        key = frozenset((name, data) for name, data in files.items() if name.endswith(".xml"))
    except (KeyError, OSError, zipfile.BadZipFile):
        other.write_bytes(path.read_bytes())
    if key not in _SAID:
        _SAID[key] = _lines(["bash", program, str(other)], re.compile("No errors found|https://"))
    return _SAID[key]


def _lines(command: list[str], left_out: re.Pattern[str]) -> list[str]:
    """What a program prints, and its exit code unless that is 0."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT, check=False
        )
    except subprocess.TimeoutExpired:
        return ["no end"]
    lines = [line for line in (done.stdout + done.stderr).splitlines() if line and not left_out.search(line)]
    return lines + ([f"exit code {done.returncode}"] if done.returncode else [])


OTHERS: dict[str, Callable[[Path, str], list[str]]] = {"FMPy": fmpy, "fmutool": fmutool, "VDMCheck3": vdmcheck}


@dataclass(frozen=True)
class Outcome:
    """Who caught a broken FMU."""

    name: str
    rule: str
    caught: frozenset[str]


def complaints(checker: str, program: str, path: Path) -> frozenset[str]:
    """What a checker complains of, without numbers and the names of files."""
    said = OTHERS[checker](path, program)
    return frozenset(re.sub(r"\d+", "#", line.replace(str(path.parent), "").replace(path.stem, "")) for line in said)


@cache
def of_good_ones(checker: str, program: str) -> frozenset[str]:
    """What a checker complains of in the FMUs that are not broken."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [build_ball(Path(folder), "", interface) for interface in INTERFACES]
        return frozenset().union(*(complaints(checker, program, path) for path in paths))


@cache
def mutants() -> dict[str, Mutant]:
    """All, by name."""
    return {m.name: m for m in (*static(), *behavioural())}


def judge(task: tuple[str, dict[str, str]]) -> Outcome:
    """Let every checker look at a broken FMU.

    Args:
        task: its name, and the programs of the other checkers by their names.
    """
    name, programs = task
    mutant = mutants()[name]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "broken.fmu"
        mutant.make(path)
        caught = {c for c, p in programs.items() if complaints(c, p, path) - of_good_ones(c, p)}
        if mutant.rule in {f.rule for f in check_fmu(path, mutant.options).findings}:
            caught.add(CHECK)
    return Outcome(name, mutant.rule, frozenset(caught))


def rows(outcomes: list[Outcome], checkers: list[str]) -> Iterator[str]:
    """The table, by kind of mutation."""
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        groups[outcome.name.partition(" ")[0]].append(outcome)
    yield f"| mutation in | FMUs | {' | '.join(checkers)} |"
    yield "|---" * (2 + len(checkers)) + "|"
    for group, found in [*((g, groups[g]) for g in GROUPS if g in groups), ("all", outcomes)]:
        counts = " | ".join(str(sum(c in o.caught for o in found)) for c in checkers)
        yield f"| {group} | {len(found)} | {counts} |"


def main() -> int:
    """Run all checkers and print the table; exit code 1 when ``check`` misses one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fmutool", metavar="PROGRAM")
    parser.add_argument("--vdmcheck", metavar="VDMCheck3.sh")
    parser.add_argument("--only", default="", help="mutations whose name contains this text")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    named = {"FMPy": "-", "fmutool": arguments.fmutool, "VDMCheck3": arguments.vdmcheck}
    programs = {checker: program for checker, program in named.items() if program}
    tasks = [(name, programs) for name in mutants() if arguments.only in name]
    with ProcessPoolExecutor(arguments.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        outcomes = list(pool.map(judge, tasks))
    print("\n".join(rows(outcomes, [CHECK, *programs])))
    missed = [o for o in outcomes if CHECK not in o.caught]
    for outcome in missed:
        print(f"check does not name {outcome.rule} in {outcome.name}")
    alone = sum(o.caught == {CHECK} for o in outcomes)
    print(f"caught by check alone: {alone} of {len(outcomes)}; by none: {sum(not o.caught for o in outcomes)}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
