"""What pipelines hand to fmu-check reaches it word by word, and installs what this revision names."""

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest
import yaml

from tests.support.copies import ROOT
from tests.support.pipelines import commit, done_by_gitlab, done_by_runner, run

PLACE = Path("tools") / "fmu-check"
HOSTILE = [
    "my model.fmu", "$(touch pwned)", "`touch pwned`", "; touch pwned", "a.fmu && touch pwned", "\"; touch pwned; \"",
    "' ; touch pwned ; '", "*", "$HOME", "${IFS}x", "--trust", "-h", "a\\nb", "# a: b", "{x: y}", "> pwned", "é ü",
]  # fmt: skip
RECORDER = """#!/usr/bin/env bash
printf '%s\\0' "$@" > "$RECORDED"
"""


def required_by(distribution: str) -> set[str]:
    """What a distribution needs to run, and what that needs."""
    given = {re.split(r"[<>=!~; ]", text)[0] for text in requires(distribution) or () if "extra ==" not in text}
    return given.union(*(required_by(name) for name in given))


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A repository whose checker writes down what it is called with."""
    folder = tmp_path / "published"
    target = folder / PLACE
    target.mkdir(parents=True)
    for name in ("action.yml", "gitlab.yml", "words"):
        (target / name).write_bytes((ROOT / PLACE / name).read_bytes())
    (target / "run").write_text(RECORDER)
    for name in ("run", "words"):
        (target / name).chmod(0o755)
    commit(folder)
    monkeypatch.setenv("RECORDED", str(tmp_path / "words"))
    (tmp_path / "user").mkdir()
    return target


def words(tmp_path):
    assert list((tmp_path / "user").iterdir()) == [] or not (tmp_path / "user" / "pwned").exists()
    return (tmp_path / "words").read_text(encoding="utf-8").split("\0")[:-1]


def test_github_hands_over_words_as_they_are(place, tmp_path):
    action = yaml.safe_load((place / "action.yml").read_text(encoding="utf-8"))
    given = {"fmus": "\n".join(HOSTILE) + "\n", "args": "--fail-on=warning\n--policy=$(touch pwned)"}
    assert done_by_runner(action, given, place, tmp_path / "user") == 0
    reports = ["--github", "--sarif=fmu-check.sarif", "--junit=fmu-check.xml"]
    assert words(tmp_path) == [*reports, "--fail-on=warning", "--policy=$(touch pwned)", "--", *HOSTILE]


@pytest.mark.parametrize("ref", ["main", "v1", "the commit"])
def test_gitlab_hands_over_words_as_they_are(place, tmp_path, ref):
    root = place.parents[1]
    assert run(["git", "tag", "v1"], root).returncode == 0
    chosen = run(["git", "rev-parse", "HEAD"], root).stdout.strip() if ref == "the commit" else ref
    given = {"fmus": "\n".join(HOSTILE), "args": "--fail-on=warning\n--policy=$(touch pwned)", "ref": chosen}
    done, _ = done_by_gitlab(place, given | {"repository": root.as_uri()}, tmp_path / "user", tmp_path)
    assert done.returncode == 0, done.stderr
    reports = ["--junit", "fmu-check.xml", "--code-quality", "fmu-check.json"]
    assert words(tmp_path) == [*reports, "--fail-on=warning", "--policy=$(touch pwned)", "--", *HOSTILE]


@pytest.mark.parametrize(
    "given", [{"ref": "$(touch pwned)"}, {"ref": "--upload-pack=touch pwned"}, {"repository": '"; touch pwned; "'}]
)
def test_what_cannot_be_fetched_runs_nothing(place, tmp_path, given):
    usual = {"fmus": "a.fmu", "repository": place.parents[1].as_uri(), "ref": "main"}
    done, _ = done_by_gitlab(place, usual | given, tmp_path / "user", tmp_path)
    assert done.returncode != 0
    assert list((tmp_path / "user").iterdir()) == []
    assert not (tmp_path / "words").exists()


def test_what_is_installed_has_one_version_and_hashes():
    project = tomllib.loads((ROOT / PLACE / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = {re.split(r"[<>=!~; ]", text)[0] for text in (
        *project["project"]["dependencies"], *project["build-system"]["requires"]
    )}  # fmt: skip
    text = (ROOT / PLACE / "requirements.lock").read_text(encoding="utf-8")
    entries = re.split(r"\n(?=\S)", text.replace("\\\n", ""))
    found = {entry.partition("==")[0]: entry for entry in entries if entry.strip()}
    assert set(found) == wanted | {name for given in wanted for name in required_by(given)}
    assert all(re.match(r"[\w-]+==[\w.]+ .*--hash=sha256:[0-9a-f]{64}", entry) for entry in found.values())
    runner = (ROOT / PLACE / "run").read_text(encoding="utf-8")
    lines = [line for line in runner.splitlines() if re.search(r"pip.* install|\$\{pip\[@\]\}", line)]
    assert "--require-hashes -r" in runner
    assert all(re.search(r"--require-hashes|--no-deps --no-build-isolation|^    pip=", line) for line in lines), lines
