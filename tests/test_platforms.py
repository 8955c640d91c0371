"""The README's table of platforms says what the project builds, tests and offers."""

import re
from pathlib import Path

import pytest
import yaml

from orchestrator.building.installing import PLATFORMS
from orchestrator.cli import COMMANDS
from orchestrator.shared.isolation import landlock, seccomp
from tests.fmi import test_exchange_hosts, test_hosts

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| ([^|]+?) \| ([^|]+?) \|$", TEXT.partition("## What runs where")[2], re.MULTILINE))
HOSTS = (ROOT / "docs" / "hosts.md").read_text(encoding="utf-8")


def row(name):
    (found,) = (text for title, text in ROWS.items() if name in title)
    return found


def test_each_platform_of_a_wheel_has_a_row():
    names = {"linux": "Linux", "darwin": "macOS", "win32": "Windows"}
    assert {names[made_for.system] for made_for in PLATFORMS.values()} == set(names.values())
    for name in ("macOS", "Windows"):
        assert "release wheels" in row(name)
    machines = {made_for.machine for made_for in PLATFORMS.values() if made_for.system == "linux"}
    assert machines == {"x86_64", "aarch64"}
    assert "Linux, x86-64 and arm64" in ROWS


def test_ci_runs_where_the_row_says():
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))["jobs"]
    systems = {job["runs-on"] for job in jobs.values()}
    assert "ubuntu-latest" in systems  # x86-64
    assert not [system for system in systems if "macos" in system or "arm" in system]
    assert "CI runs on x86-64" in row("Linux")
    assert "untested" in row("macOS")


@pytest.mark.parametrize(("name", "system"), [("macOS", "darwin"), ("Windows", "win32")])
def test_there_is_no_sandbox_where_the_row_says_so(name, system, monkeypatch):
    monkeypatch.setattr("sys.platform", system)
    assert landlock.version() == 0
    assert not seccomp.available()
    assert "No sandbox" in row(name)


def test_hosts_of_the_row_are_compared_and_tested():
    sources = Path(test_hosts.__file__).read_text() + Path(test_exchange_hosts.__file__).read_text()
    title = next(title for title in ROWS if title.startswith("FMPy"))
    for host in title.split(", "):
        assert re.search(rf"^\| [^|]*\b{host}\b", HOSTS, re.MULTILINE), host
        assert host.lower() in sources.lower(), host


def test_commands_of_the_row_exist():
    names = {text.split()[0] for text in re.findall(r"`([^`]+)`", row("exported as FMUs"))}
    assert names <= set(COMMANDS)
    assert len(names) == 4
