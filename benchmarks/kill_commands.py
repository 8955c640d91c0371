"""Kills commands at random moments over an older result: it stays whole or the new one is whole, and nothing is left.

    python -m benchmarks.kill_commands                               # 5 kills of each of six commands
    python -m benchmarks.kill_commands --kills 30 --commands estimate

SIGKILL, SIGTERM and SIGINT come in turn; SIGINT goes to the process group, as Ctrl-C does. After each kill no process
of the command may live, and the result must be one of the two. After the kills the command runs once more: then nothing
may lie in the temporary directory, beside the result, or half written in the cache. Linux only; exit code 1 when
anything of this does not hold.
"""

import argparse
import contextlib
import json
import os
import random
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.engine_process import children
from tests.support.workbench import Served, workbench

ROOT = Path(__file__).resolve().parents[1]
RECORD, MODEL = "docs/examples/machine.csv", "docs/examples/machine.toml"
ESTIMATE = ["estimate", RECORD, "--model", MODEL, "--no-diagnose"]
DIAGNOSE = ["diagnose", RECORD, "--model", MODEL, "--effects", "backlash@shaft"]
# The command that leaves the older result, and the one that is killed.
COMMANDS = {
    "sweep": (["sweep", "--sizes", "0.01,0.02"], ["sweep", "--sizes", "random:300", "--resume"]),
    "diagnose": ([*DIAGNOSE, "--rate", "100"], DIAGNOSE),
    "estimate": ([*ESTIMATE, "--rate", "100"], ESTIMATE),
    "build": (["build", "Drivetrain", "LqrController"], ["build", "Drivetrain", "LqrController", "--force"]),
    "check": (["check", "{fmus}/KalmanEstimator.fmu", "--static"], ["check", "{fmus}/KalmanEstimator.fmu"]),
}  # fmt: skip
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ENDS = 30.0  # s, within which a stopped command and all its processes must have ended
RESULTS = {"estimate.json", "report.html"}
MARK = "KILL_COMMANDS_MARK"


@dataclass
class Place:
    """Folders of one command: its temporary files, cache and result; and what was found wrong."""

    folder: Path
    faults: list[str] = field(default_factory=list)
    slowest: float = 0.0

    def __post_init__(self) -> None:
        for path in (self.temporary, self.cache, self.out.parent):
            path.mkdir(parents=True)

    @property
    def temporary(self) -> Path:
        return self.folder / "temporary"

    @property
    def cache(self) -> Path:
        return self.folder / "cache"

    @property
    def out(self) -> Path:
        return self.folder / "results" / "out"

    def environment(self, mark: str) -> dict[str, str]:
        """Return the variables of a command."""
        own = {"TMPDIR": str(self.temporary), "XDG_CACHE_HOME": str(self.cache), MARK: mark, "PYTHONPATH": str(ROOT)}
        return {**os.environ, **own}

    def check_rest(self) -> None:
        """Note what a run that has ended well has left."""
        for path in self.temporary.iterdir():
            self.faults.append(f"left in the temporary directory: {path.name}")
        for path in (p for p in self.out.parent.iterdir() if p != self.out):
            self.faults.append(f"left beside the result: {path.name}")
        for path in self.cache.rglob("*"):
            if path.name.startswith((".", "backlash-cosim-")) and path.parent.name != "zig":
                self.faults.append(f"left in the cache: {path.relative_to(self.cache)}")


def started(pid: int) -> str | None:
    """Return when a process was started, in ticks; nothing of one that has ended."""
    with contextlib.suppress(OSError):
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return None if words[0] == "Z" else words[19]
    return None


def family(pid: int) -> dict[int, str | None]:
    """Return the descendants of a process by their ids, with their start."""
    found: dict[int, str | None] = {}
    waiting = [pid]
    while waiting:
        waiting += (mine := children(waiting.pop()))
        found |= {child: started(child) for child in mine}
    return found


def marked(mark: str) -> dict[int, str | None]:
    """Return the processes whose environment holds the mark."""
    found = {}
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark.encode() in path.read_bytes():
                found[int(path.parent.name)] = started(int(path.parent.name))
    return found


def find_left(mark: str, known: dict[int, str | None]) -> list[str]:
    """Wait until all processes have ended, and return the command lines of those that have not."""
    end = time.monotonic() + ENDS
    while True:
        alive = [p for p, begun in (known | marked(mark)).items() if begun is not None and started(p) == begun]
        if not alive or time.monotonic() > end:
            break
        time.sleep(0.1)
    lines = []
    for pid in alive:
        with contextlib.suppress(OSError):
            lines.append(Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()[:150])
            os.kill(pid, signal.SIGKILL)
    return lines


def files_of(folder: Path) -> dict[str, int]:
    """Return the inode of each file of a result; neither the journal of an unfinished sweep nor FMUs belong to it."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {n: path.stat().st_ino for n, path in found.items() if n != "sweep.journal" and path.suffix != ".fmu"}


def compare(out: Path, old: dict[str, int], new: set[str]) -> tuple[str, str]:
    """Return whether the result is the old or the new one, and else what is wrong with it."""
    found = files_of(out)
    for path in out.rglob("*.fmu"):  # of `build`, each a result by itself
        if not zipfile.is_zipfile(path) or zipfile.ZipFile(path).testzip():
            return "mixed", f"{path.name} is damaged"
    if found == old:
        return "old", ""
    stale = sorted(name for name, inode in found.items() if old.get(name) == inode)
    if stale or set(found) != new:
        return "mixed", f"old {stale}, missing {sorted(new - set(found))}, more {sorted(set(found) - new)}"
    for path in out.rglob("*.json"):
        json.loads(path.read_text())
    return "new", ""


def run(place: Place, words: list[str], out: Path | None = None) -> float:
    """Run a command to its end and return the seconds that it took."""
    start = time.monotonic()
    command = [sys.executable, "-m", "orchestrator", *words, "--out", str(out or place.out)]
    done = subprocess.run(command, cwd=ROOT, env=place.environment(""), capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or "Traceback" in done.stderr:
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}: {done.stderr}")
    return time.monotonic() - start


def kill(place: Place, words: list[str], number: signal.Signals, after: float) -> bool:
    """Start a command, send it a signal, and wait until it has ended; return whether the signal came before that."""
    mark = secrets.token_hex(8)
    command = [sys.executable, "-m", "orchestrator", *words, "--out", str(place.out)]
    process = subprocess.Popen(
        command, cwd=ROOT, env=place.environment(mark), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(after)
    known = family(process.pid)
    begun = time.monotonic()
    in_time = process.poll() is None
    if in_time:
        os.killpg(process.pid, number) if number is signal.SIGINT else process.send_signal(number)
    try:
        _, said = process.communicate(timeout=ENDS)
    except subprocess.TimeoutExpired:
        process.kill()
        said = process.communicate()[1]
        place.faults.append(f"did not end within {ENDS:g} s of {number.name}")
    place.slowest = max(place.slowest, time.monotonic() - begun)
    if "Traceback" in said or process.returncode not in (0, 1, -number, 128 + number):  # the former: at its very start
        place.faults.append(f"{number.name}: ended with {process.returncode}: {said[-600:]}")
    place.faults += [f"{number.name}: still runs: {line}" for line in find_left(mark, known)]
    return in_time


def kill_command(place: Place, name: str, kills: int, dice: random.Random) -> str:
    """Kill one command over and over, and return what its results were."""
    fmus = place.folder / "fmus"
    older, newer = ([word.replace("{fmus}", str(fmus)) for word in words] for words in COMMANDS[name])
    if name == "check":
        run(place, ["build", "KalmanEstimator"], fmus)
    run(place, older)
    kept = place.folder / "older"
    shutil.copytree(place.out, kept)
    run(place, newer)
    took = run(place, newer)
    new = set(files_of(place.out))
    counts = dict.fromkeys(("old", "new", "mixed"), 0)
    killed = 0
    while killed < kills:
        shutil.rmtree(place.out)
        shutil.copytree(kept, place.out)
        old = files_of(place.out)
        number, after = SIGNALS[killed % len(SIGNALS)], dice.uniform(0.0, took)
        if not kill(place, newer, number, after):
            took = after  # it was quicker than the calm run: a busy machine
            continue
        killed += 1
        state, wrong = compare(place.out, old, new)
        counts[state] += 1
        if wrong:
            place.faults.append(f"{number.name} after {after:.2f} s: {wrong}")
    run(place, newer)
    if compare(place.out, {}, new)[0] != "new":
        place.faults.append("the run after the kills has another result")
    return f"{counts['old']} old, {counts['new']} new, {counts['mixed']} mixed; a calm run takes {took:.1f} s"


def kill_job(place: Place, _: str, kills: int, dice: random.Random) -> str:
    """Kill the workbench while a job runs, and return what became of the jobs."""
    log, model = ROOT / RECORD, ROOT / MODEL

    def start(served: Served) -> str:
        return served.start("estimate", [served.upload(log)], model=served.upload(model), no_diagnose=True)

    begun = time.monotonic()
    with workbench(place.out, environment=place.environment("")) as served:
        name = start(served)
        if served.wait(name)["state"] != "done":
            raise SystemExit(f"an undisturbed job ends with {served.job(name)}")
    took = time.monotonic() - begun
    whole = set(files_of(place.out / "results" / name))
    counts = dict.fromkeys(("none", "whole", "mixed"), 0)
    for n in range(kills):
        number, mark = SIGNALS[n % len(SIGNALS)], secrets.token_hex(8)
        with workbench(place.out, environment=place.environment(mark)) as served:
            name = start(served)
            time.sleep(dice.uniform(0.0, took))
            known = family(served.process.pid)
            begun = time.monotonic()
            served.process.send_signal(number)
            try:
                served.process.wait(ENDS)
            except subprocess.TimeoutExpired:
                served.process.kill()
                place.faults.append(f"the workbench did not end within {ENDS:g} s of {number.name}")
            place.slowest = max(place.slowest, time.monotonic() - begun)
        place.faults += [f"{number.name}: still runs: {line}" for line in find_left(mark, known)]
        found = set(files_of(place.out / "results" / name))
        state = "whole" if found >= whole else "mixed" if found & RESULTS else "none"
        counts[state] += 1
        if state == "mixed":
            place.faults.append(f"{number.name}: {name} holds {sorted(found)}")
    with workbench(place.out, environment=place.environment("")) as served:
        served.wait(start(served))
    return f"{counts['none']} without a result, {counts['whole']} whole, {counts['mixed']} in part"


def main() -> int:
    """Kill, compare, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=5, help="of each command")
    parser.add_argument("--commands", default=",".join((*COMMANDS, "workbench")))
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    dice, faults = random.Random(args.seed), 0
    for name in args.commands.split(","):
        with tempfile.TemporaryDirectory() as folder:
            place = Place(Path(folder))
            said = (kill_job if name == "workbench" else kill_command)(place, name, args.kills, dice)
            place.check_rest()
            print(
                f"{name:10}{args.kills} kills: {said}; it ended at most {place.slowest:.1f} s after a signal",
                flush=True,
            )
            for fault in place.faults:
                print(f"  WRONG {fault}", flush=True)
            faults += len(place.faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
