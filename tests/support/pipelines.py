"""Pipelines that use fmu-check, done as their platforms do them."""

import os
import re
import subprocess

import yaml

from tests.support.waiting import HANGS


def run(words, folder, **environment):
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("GITHUB_", "PYTHON"))}
    words = [str(word) for word in words]
    return subprocess.run(
        words, cwd=folder, capture_output=True, text=True, check=False, env=clean | environment, timeout=HANGS
    )


def commit(folder):
    who = ["-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "init.defaultBranch=main"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "all"]):
        done = run(["git", *who, *words], folder)
        assert done.returncode == 0, done.stderr


def done_by_runner(action, given, place, folder):
    """Do the steps of a composite action as GitHub's runner does; return the exit code."""
    assert action["runs"]["using"] == "composite"
    inputs = {name: given.get(name, entry.get("default", "")) for name, entry in action["inputs"].items()}
    known = {f"inputs.{name}": value for name, value in inputs.items()} | {"github.action_path": str(place)}

    def filled(text):
        return re.sub(r"\$\{\{ *([\w.]+) *\}\}", lambda match: known[match[1]], text)

    for step in action["runs"]["steps"]:
        assert step["shell"] == "bash"
        words = {name: filled(value) for name, value in step.get("env", {}).items()}
        script = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", filled(step["run"])]
        done = run(script, folder, GITHUB_STEP_SUMMARY=str(folder / "summary.md"), GITHUB_ACTIONS="true", **words)
        (folder / "said.txt").write_text(done.stdout, encoding="utf-8")
        if done.returncode:
            return done.returncode
    return 0


def done_by_gitlab(place, given, folder, temporary):
    """Do the job of the template as GitLab's runner does; return what came of the script, and the job."""
    header, body = yaml.safe_load_all((place / "gitlab.yml").read_text(encoding="utf-8"))
    inputs = {name: given.get(name, (entry or {}).get("default")) for name, entry in header["spec"]["inputs"].items()}
    assert None not in inputs.values()

    def filled(value):
        if isinstance(value, dict):
            return {key: filled(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [filled(inner) for inner in value]
        if not isinstance(value, str):
            return value
        return re.sub(r"\$\[\[ *inputs\.(\w+) *\]\]", lambda match: inputs[match[1]], value)

    (job,) = filled(body).values()
    variables = {}
    for name, entry in job.get("variables", {}).items():
        plain = isinstance(entry, str)
        text = entry if plain else entry["value"]
        # The runner replaces variables within variables, unless it is told not to.
        variables[name] = os.path.expandvars(text) if plain or entry.get("expand", True) else text
    script = ["bash", "-eo", "pipefail", "-c", "\n".join(job["script"])]
    return run(script, folder, TMPDIR=str(temporary), **variables), job
