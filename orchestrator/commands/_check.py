"""What ``check`` and the program ``fmu-check`` share: options, what is printed, and the files of reports."""

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec

from orchestrator.checking.batch import policy_of
from orchestrator.checking.check import TOTAL, CheckOptions
from orchestrator.checking.findings import SEVERITIES
from orchestrator.checking.formats.code_quality import as_code_quality
from orchestrator.checking.formats.github import as_annotations, as_summary
from orchestrator.checking.formats.junit import as_junit
from orchestrator.checking.formats.sarif import as_sarif
from orchestrator.checking.formats.text import as_lines, as_results
from orchestrator.checking.mending.members import UnmendableError
from orchestrator.checking.mending.mend import Repair, mend_fmu
from orchestrator.checking.policy import FILE_NAME, Policy
from orchestrator.checking.verdict import Verdict, baseline_of
from orchestrator.commands._progress_lines import ProgressLines, is_for_programs
from orchestrator.commands._trust import add_trust, positive
from orchestrator.errors import FmuError, InputError, OutputError
from orchestrator.plain_text import plain_text
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.output import write_whole
from orchestrator.shared.results import as_plain

_REPORTS: dict[str, tuple[str, Callable[[Sequence[Verdict]], str]]] = {
    "json": ("JSON", lambda verdicts: json.dumps(as_plain(as_results(verdicts)), indent=1) + "\n"),
    "junit": ("JUnit XML", as_junit),
    "sarif": ("SARIF 2.1.0", as_sarif),
    "code-quality": ("Code Quality JSON, as GitLab reads it", as_code_quality),
}
_SUMMARY = "GITHUB_STEP_SUMMARY"


def add_check_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--static", action="store_true", help="execute nothing")
    add_trust(parser)
    parser.add_argument(
        "--policy", type=Path, metavar="FILE.toml",
        help=f"rules to apply and their severities (default: {FILE_NAME} if it exists)",
    )  # fmt: skip
    parser.add_argument("--fail-on", choices=SEVERITIES, help="the least severity that fails (default: error)")
    parser.add_argument("--baseline", type=Path, metavar="FILE", help="known findings, which do not cause a failure")
    parser.add_argument(
        "--write-baseline", type=Path, metavar="FILE", help="write all findings to a baseline of known findings"
    )
    for name, (what, _) in _REPORTS.items():
        parser.add_argument(f"--{name}", type=Path, metavar="FILE", help=f"also write the findings as {what}")
    parser.add_argument(
        "--fix", type=Path, metavar="DIR", help="write repaired FMUs to this folder, and check them instead"
    )
    parser.add_argument("--github", action="store_true", help="also print annotations and write the step's summary")
    limits, archive = Limits(), ArchiveLimits()
    for name, default, metavar, what in (
        ("time", limits.time, "S", "wall time limit of one call"),
        ("total", TOTAL, "S", "time limit of all calls of an FMU; the result names skipped probes"),
        ("memory", limits.memory / MEBIBYTE, "MIB", "memory that the running FMU may take"),
        ("size", archive.total / MEBIBYTE, "MIB", "size that the unpacked FMU may have"),
    ):
        parser.add_argument(
            f"--{name}-limit", type=positive, default=default, metavar=metavar, help=f"{what} (default: %(default)g)"
        )


def check_options(args: argparse.Namespace) -> CheckOptions:
    """Return how the arguments want FMUs to be checked."""
    return CheckOptions(
        static=args.static,
        trust=args.trust,
        archive=ArchiveLimits(total=int(args.size_limit * MEBIBYTE)),
        limits=Limits(time=args.time_limit, memory=int(args.memory_limit * MEBIBYTE), total=args.total_limit),
    )


def read_arguments(args: argparse.Namespace) -> Policy:
    """Return the policy that the arguments name, with what they say themselves, after a look at where reports go."""
    for option, target in _targets(args):
        _require_place(target, option)
    if args.github and not os.environ.get(_SUMMARY):
        raise InputError(f"`--github` must be given where {_SUMMARY} names a file, but it names none")
    usual = Path(FILE_NAME)
    policy = policy_of(args.policy or (usual if usual.is_file() else None))
    given = {"fail_on": args.fail_on, "baseline": args.baseline and str(args.baseline)}
    return msgspec.structs.replace(policy, **{name: value for name, value in given.items() if value})


def mend_fmus(args: argparse.Namespace, paths: Sequence[Path]) -> list[Path]:
    """Mend FMUs, where that was asked for, and say so; return what to check: those, and those with nothing to mend."""
    if args.fix is None:
        return list(paths)
    targets = [args.fix / path.with_suffix(".fmu").name for path in paths]
    if len(set(targets)) < len(targets):
        raise FmuError("`--fix` must be given FMUs of different names, but two have the same")
    try:
        args.fix.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"`--fix` must be a folder that can be written, but is not: {error.strerror}") from None
    found = []
    for path, target in zip(paths, targets, strict=True):
        try:
            repair = mend_fmu(path, target, check_options(args).archive)
        except UnmendableError as error:  # the check says the same as a finding
            print(plain_text(f"{path}: not mended: {error}"))
            repair = Repair((), ())
        if repair.done:
            print(plain_text(f"{path}: mended as {target}"))
        for line in (*repair.done, *(f"not mended: {text}" for text in repair.left)):
            print(plain_text(f"  {line}"))
        found.append(target if repair.done else path)
    return found


class _Shown:
    """Prints verdicts; what is done and its share stand below on a terminal, or go to programs."""

    def __init__(self, count: int) -> None:
        self._count, self._done = count, 0
        self._shows = sys.stderr.isatty() and not is_for_programs()
        self._lines = ProgressLines()

    def __call__(self, verdict: Verdict) -> None:
        self._done += 1
        self.clear()
        print("\n".join(as_lines(verdict)), flush=True)
        self.tell("checked", 0.0)

    def tell(self, stage: str, share: float) -> None:
        """Say what is done now with the present FMU, and the share of its checks that are done (0 to 1)."""
        text = f"{self._done} of {self._count} FMUs checked"
        text += f"; {stage}" if self._done < self._count else ""
        self._lines.tell(text, (self._done + share) / self._count if self._count else 1.0, None)
        if self._shows and self._done < self._count:
            sys.stderr.write(f"\r\x1b[K{text} ...")
            sys.stderr.flush()

    def clear(self) -> None:
        """Take the line below away."""
        if self._shows:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()


@contextmanager
def verdicts_shown(count: int) -> Iterator[_Shown]:
    """Yield what prints a verdict and shows progress."""
    shown = _Shown(count)
    shown.tell("", 0.0)
    try:
        yield shown
    finally:
        shown.clear()


def write_reports(args: argparse.Namespace, verdicts: Sequence[Verdict]) -> None:
    """Write the reports that were asked for, each whole or not at all."""
    writers = {f"--{name}": writer for name, (_, writer) in _REPORTS.items()} | {"--write-baseline": baseline_of}
    for option, target in _targets(args):
        _write(target, writers[option](verdicts), option)
    if args.github:
        print("\n".join(as_annotations(verdicts)), flush=True)
        path = os.environ[_SUMMARY]
        try:
            with open(path, "a", encoding="utf-8") as stream:
                stream.write(as_summary(verdicts))
        except OSError as error:
            raise OutputError(f"{_SUMMARY} must name a file that can be written, but: {error.strerror}") from None


def _targets(args: argparse.Namespace) -> Iterator[tuple[str, Path]]:
    for name in (*_REPORTS, "write-baseline"):
        target = getattr(args, name.replace("-", "_"))
        if target is not None:
            yield f"--{name}", target


def _require_place(path: Path, option: str) -> None:
    """Refuse a file that cannot be written before the work starts, not after it."""
    special = path.exists() and not path.is_file()  # a pipe or a device would be replaced, not written to
    if special or not os.access(path.parent, os.W_OK):
        reason = (
            "in no folder that can be written" if not special else "a folder" if path.is_dir() else "a pipe or a device"
        )
        raise OutputError(f"`{option}` must be a file that can be written, but {path} is {reason}")


def _write(path: Path, text: str, option: str) -> None:
    """Write a file whole or not at all."""
    try:
        write_whole(path, text.encode("utf-8", "replace"))
    except OSError as error:
        raise OutputError(
            f"`{option}` must be a file that can be written, but {path} is not: {error.strerror}"
        ) from None
