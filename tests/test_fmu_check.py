"""The distribution fmu-check in a fresh environment, and the integrations that start it: action, GitLab, pre-commit.

They need an index of packages, so they run where they are asked for: ``pytest -m network -s tests/test_fmu_check.py``.
"""

import json
import shlex
import sys
import time
from pathlib import Path

import jsonschema
import pytest
import yaml
from lxml import etree

from tests.support.c_fmu import build_c_fmu
from tests.support.pipelines import commit, done_by_gitlab, done_by_runner, run
from tests.support.schemas import json_schema, junit_schema

pytestmark = [pytest.mark.network, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[1]
PLACE = Path("tools") / "fmu-check"
MOST_MEBIBYTES = 60
HEAVY = {"fmpy", "matplotlib", "numpy", "rich", "scipy"}
ACTION_SCHEMA = "https://json.schemastore.org/github-action.json"
GITLAB_SCHEMA = "https://gitlab.com/gitlab-org/gitlab/-/raw/master/app/assets/javascripts/editor/schema/ci.json"


@pytest.fixture(scope="module")
def repository(tmp_path_factory):
    """A repository with what git knows of this one, at the branch `main`."""
    folder = tmp_path_factory.mktemp("published") / "fmu-check"
    run(["git", "-C", ROOT, "checkout-index", "-a", f"--prefix={folder}/"], ROOT)
    commit(folder)
    return folder


@pytest.fixture
def user(tmp_path):
    """A user's repository with a good and a bad FMU."""
    folder = tmp_path / "user"
    (folder / "fmus").mkdir(parents=True)
    build_c_fmu(folder / "fmus", name="good")
    build_c_fmu(folder / "fmus", "crash_step", name="bad")
    commit(folder)
    return folder


def fmu_of_version_3(folder):
    """Build one of our FMUs of FMI 3.0."""
    words = ["build", "LqrController", "--native", "--fmi", "3", "--out", folder]
    done = run([sys.executable, "-m", "orchestrator", *words], ROOT)
    assert done.returncode == 0, done.stderr
    return folder / "LqrController.fmu"


def assert_reports(junit, said):
    """The good FMU passes, the bad one fails by the rule meant."""
    suites = etree.parse(str(junit)).getroot()
    junit_schema().assertValid(suites)
    failed = {Path(s.get("name")).name: [c.get("name") for c in s if c.find("failure") is not None] for s in suites}
    assert failed == {"good.fmu": [], "bad.fmu": ["run.crash"]}, said


def test_it_installs_small_and_quickly_and_checks_fmus(tmp_path, repository, user, capsys):
    begin = time.monotonic()
    venv = tmp_path / "venv"
    done = run([sys.executable, "-m", "venv", venv], tmp_path)
    assert done.returncode == 0, done.stderr
    done = run([venv / "bin" / "python", "-m", "pip", "install", "-q", repository / PLACE], tmp_path)
    assert done.returncode == 0, done.stderr
    installed = time.monotonic() - begin
    size = sum(p.lstat().st_size for p in venv.rglob("*")) / 2**20
    distributions = {p.name.partition("-")[0].lower() for p in venv.rglob("*.dist-info")}
    program = venv / "bin" / "fmu-check"
    seconds = {}
    for version, fmu in {"2.0": user / "fmus" / "good.fmu", "3.0": fmu_of_version_3(tmp_path)}.items():
        begin = time.monotonic()
        done = run([program, fmu, "--json", f"{version}.json"], tmp_path)
        seconds[version] = time.monotonic() - begin
        assert done.returncode == 0, done.stdout + done.stderr
        (found,) = json.loads((tmp_path / f"{version}.json").read_text(encoding="utf-8"))["fmus"]
        assert found["executed"] is True
        assert found["facts"]["fmiVersion"] == version
    with capsys.disabled():
        checks = ", ".join(f"FMI {version}: {s:.1f} s" for version, s in seconds.items())
        print(f"\nfmu-check: {size:.0f} MiB with pip and venv, installed in {installed:.1f} s; a check of {checks}")
    assert not HEAVY & distributions
    assert size <= MOST_MEBIBYTES
    done = run([program, user / "fmus"], tmp_path)
    assert (done.returncode, "run.crash" in done.stdout) == (1, True)
    assert run([venv / "bin" / "python", "-m", "fmu_check", "none.fmu"], tmp_path).returncode == 2


def test_the_action_runs_as_on_a_runner(repository, user):
    action = yaml.safe_load((repository / PLACE / "action.yml").read_text(encoding="utf-8"))
    given = {"fmus": "fmus/good.fmu\nfmus/bad.fmu\n", "args": "--time-limit=10"}
    assert done_by_runner(action, given, repository / PLACE, user) == 1
    assert_reports(user / "fmu-check.xml", "")
    summary = (user / "summary.md").read_text(encoding="utf-8")
    assert "| fmus/good.fmu | ok | yes |" in summary
    assert "| fmus/bad.fmu | **failed** | yes |" in summary
    sarif = json.loads((user / "fmu-check.sarif").read_text(encoding="utf-8"))
    assert {r["ruleId"] for r in sarif["runs"][0]["results"] if r["level"] == "error"} == {"run.crash"}
    said = (user / "said.txt").read_text(encoding="utf-8")
    assert "::error file=fmus/bad.fmu,title=run.crash::" in said
    assert done_by_runner(action, {"fmus": "fmus/good.fmu"}, repository / PLACE, user) == 0


def test_the_template_for_gitlab_runs_as_in_a_job(repository, user, tmp_path):
    given = {"fmus": "fmus/good.fmu\nfmus/bad.fmu", "repository": repository.as_uri(), "ref": "main"}
    done, job = done_by_gitlab(repository / PLACE, given, user, tmp_path)
    assert done.returncode == 1, done.stderr
    assert_reports(user / job["artifacts"]["reports"]["junit"], done.stdout)
    issues = json.loads((user / job["artifacts"]["reports"]["codequality"]).read_text(encoding="utf-8"))
    assert {i["check_name"] for i in issues if i["severity"] == "major"} == {"run.crash"}


def test_the_hook_runs_under_pre_commit(repository, user, tmp_path):
    home = {"PRE_COMMIT_HOME": str(tmp_path / "cache"), "HOME": str(tmp_path)}
    words = [sys.executable, "-m", "pre_commit", "try-repo", repository, "fmu-check", "--verbose", "--files"]
    good = run([*words, "fmus/good.fmu"], user, **home)
    assert good.returncode == 0, good.stdout + good.stderr
    assert "good.fmu: no findings" in good.stdout
    bad = run([*words, "fmus/good.fmu", "fmus/bad.fmu"], user, **home)
    assert bad.returncode == 1
    assert "run.crash" in bad.stdout


def test_the_files_of_the_integrations_are_valid():
    action = yaml.safe_load((ROOT / PLACE / "action.yml").read_text(encoding="utf-8"))
    jsonschema.validate(action, json_schema(ACTION_SCHEMA))
    _, job = yaml.safe_load_all((ROOT / PLACE / "gitlab.yml").read_text(encoding="utf-8"))
    variables = job["fmu-check"]["variables"]
    assert all(set(variable) == {"value", "expand"} for variable in variables.values())
    # The packaged schema is older than GitLab 15.6, which brought `expand`: the rest is held to it with plain values.
    job["fmu-check"]["variables"] = {name: variable["value"] for name, variable in variables.items()}
    jsonschema.validate(job, json_schema(GITLAB_SCHEMA))


def test_the_workflow_of_the_project_uses_the_action():
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    steps = [step for job in yaml.safe_load(text)["jobs"].values() for step in job["steps"]]
    (used,) = [step for step in steps if step.get("uses") == f"./{PLACE.as_posix()}"]
    assert shlex.split(used["with"]["fmus"])
