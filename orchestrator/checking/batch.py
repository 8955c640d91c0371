"""The check of many FMUs under one policy."""

from collections.abc import Callable, Sequence
from pathlib import Path

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.policy import Policy, read_policy
from orchestrator.checking.verdict import Verdict, judge, read_baseline
from orchestrator.errors import FmuError


def check_fmus(
    paths: Sequence[Path],
    options: CheckOptions,
    policy: Policy,
    progress: Callable[[Verdict], None] = lambda verdict: None,
) -> list[Verdict]:
    """Check FMUs one after the other, and return a verdict of each."""
    baseline = read_baseline(Path(policy.baseline)) if policy.baseline else frozenset()
    verdicts = []
    for path in paths:
        verdicts.append(judge(check_fmu(path, options), policy, baseline))
        progress(verdicts[-1])
    return verdicts


def policy_of(path: Path | str | None) -> Policy:
    """Return the policy of a file, or the default one."""
    return Policy() if path is None else read_policy(Path(path))


def find_fmus(paths: Sequence[Path | str]) -> list[Path]:
    """Return the FMUs that paths mean: files, unpacked FMUs, and the ``*.fmu`` of folders."""
    found: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir() and not (path / "modelDescription.xml").exists():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() == ".fmu")
            if not inside:
                raise FmuError(f"a folder must have *.fmu files or a modelDescription.xml, but {path} has neither")
            found += inside
        elif path.is_file() or path.is_dir():
            found.append(path)
        else:
            raise FmuError(f"an FMU must be an existing file or folder, but {path} is not")
    return list(dict.fromkeys(found))
