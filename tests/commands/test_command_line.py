"""The command line as such: wrong words are one line that names the argument, and exit code 2."""

import os
import subprocess
import sys

import pytest

from orchestrator.cli import COMMANDS, main


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["sweep", "--seeds", "two"], "`--seeds` must be a whole number, but is 'two'"),
        (["sweep", "--seed", "1e3"], "`--seed` must be a whole number, but is '1e3'"),
        (["sweep", "--seed", "9" * 30], "`--seed` must be a whole number of at most 18 digits"),
        (["sweep", "--time-limit", "nan"], "`--time-limit` must be finite, but is 'nan'"),
        (["sweep", "--out", ""], "`--out` must be a path, but is empty"),
        (["sweep", "--seeds"], "`--seeds` must be followed by a value, but is not"),
        (["sweep", "--resume=yes"], "`--resume` must be given without a value, but has 'yes'"),
        (["sweep", "--no\nthing"], r"`--no\nthing` must be an option of `sweep`, but is none"),
        (["estimate", "log.csv", "--modle", "m.toml"], "but is none: perhaps `--model`; see "),
        (["simulate", "loop.toml"], "`loop.toml` must be left out of `simulate`, but is given: say `--scenario loop"),
        (["inspect", "a.csv", "b.csv"], "`b.csv` must be left out of `inspect`, but is given: run `inspect` once for"),
        (["inspect", "a.csv", "b.toml"], "`b.toml` must be left out of `inspect`, but is given: say `--model b.toml`"),
        (["check", "--memory-limit", "0"], "`--memory-limit` must be positive"),
        (["check", ""], "`FMU` must be a path, but is empty"),
        (["estimate", "--method", "guess"], "`--method` must be one of maximum_likelihood, ekf"),
        (["diagnose"], "`DATA` must be given"),
        (["report", "--command", "x"], "`DIR` must be given"),
        (["regulator", "--torque-weight", "-1e-3", "--seed"], "`--seed` must be an option of `regulator`, but is none"),
        (["regulator", "--gains", "--delay", "1"], "`--gains` must be followed by a value, but is not"),
        (["swep"], "`COMMAND` must be one of build, check"),
        ([], "`COMMAND` must be given"),
    ],
)
def test_wrong_words_are_one_line(capsys, words, complaint):
    with pytest.raises(SystemExit) as ending:
        main(words)
    assert ending.value.code == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert complaint in told.err
    assert told.err.count("\n") == 1


def test_a_wrong_option_points_to_the_help_of_its_own_command(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--stopp", "3"])
    told = capsys.readouterr().err.strip()
    assert told.endswith(" simulate --help")
    assert main(["simulate", "--scenario", "missing.toml"]) == 2  # what the other advice says is an option


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(capsys, command):
    with pytest.raises(SystemExit) as ending:
        main([command, "--help"])
    assert ending.value.code == 0
    assert COMMANDS[command] in " ".join(capsys.readouterr().out.split())


def test_limits_have_the_same_names_everywhere(capsys):
    for command in ("check", "sweep"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told = capsys.readouterr().out
        assert "--time-limit S" in told
        assert "--memory-limit MIB" in told


def test_names_of_any_script_are_printed_whatever_the_encoding(tmp_path):
    name = tmp_path / "ünï cödé.toml"
    name.write_text(
        'stop = 0.01\nrecord = ["plant.theta_l"]\n[master]\nstep = 1e-3\n[instances.plant]\nfmu = "Drivetrain"\n',
        encoding="utf-8",
    )
    words = [sys.executable, "-m", "orchestrator", "simulate", "--scenario", str(name), "--out", str(tmp_path / "öut")]
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert r"\xf6ut: report.html" in done.stdout


BEFORE_LIBRARIES = """
import sys
from orchestrator.cli import main

open("model.toml", "w").write("[parameters.J_x]\\nvalue = 1\\n")
open("settings.toml", "w").write("nothing = 1\\n")
for words in (
    "{0} --help", "{0} --nothing", "{0} a.csv --rate 0", "{0} a.csv --part 3:1",
    "{0} a.csv --model model.toml", "{0} a.csv --model missing.toml", "{0} a.csv --settings settings.toml",
    "{0} a.csv --time-limit -1",
):
    for command in ("estimate", "diagnose", "inspect"):
        if command == "inspect" and ("--settings" in words or "--time" in words):
            continue
        try:
            code = main(words.format(command).split())
        except SystemExit as ended:
            code = ended.code
        if code != (0 if "--help" in words else 2):
            raise SystemExit(f"{words} {command}: {code}")
    if "--help" in words:
        print("numpy" in sys.modules)
print([name for name in sys.modules if name.split(".")[0] in ("scipy", "fmpy", "matplotlib", "jinja2")])
"""


def test_help_and_mistakes_in_flags_and_model_files_wait_for_no_library(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", BEFORE_LIBRARIES], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if line.startswith(("[", "False", "True"))] == ["False", "[]"]
