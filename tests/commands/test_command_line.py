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
        (["sweep", "--nothing", "new\nline"], r"unrecognized arguments: --nothing new\nline"),
        (["check", "--memory-limit", "0"], "`--memory-limit` must be positive"),
        (["check", ""], "`FMU` must be a path, but is empty"),
        (["estimate", "--method", "guess"], "`--method` must be one of maximum_likelihood, ekf"),
        (["diagnose"], "`DATA` must be given"),
        (["report", "--command", "x"], "`DIR` must be given"),
        (["regulator", "--torque-weight", "-1e-3", "--seed"], "unrecognized arguments: --seed"),
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
