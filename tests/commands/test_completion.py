"""Shells complete commands, options and files."""

import shutil
import subprocess
import sys

import pytest

from orchestrator.cli import COMMANDS, main
from tests.support.waiting import HANGS


@pytest.fixture
def script(capsys):
    """Return the script for a shell."""
    pytest.importorskip("shtab")

    def printed(shell):
        with pytest.raises(SystemExit) as ending:
            main(["--print-completion", shell])
        assert ending.value.code == 0
        return capsys.readouterr().out

    return printed


def completed(script, *words):
    """What bash offers for the last word."""
    program = (
        f"{script}\n"
        + """
    COMP_WORDS=(backlash-cosim "$@"); COMP_CWORD=$#; COMPREPLY=()
    handler=$(complete -p backlash-cosim | sed 's/.*-F \\([^ ]*\\).*/\\1/')
    "$handler" backlash-cosim "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
    printf '%s\\n' "${COMPREPLY[@]}"
    """
    )
    bash = [str(shutil.which("bash")), "--norc", "-c", program, "bash", *words]
    done = subprocess.run(bash, capture_output=True, text=True, check=False, timeout=HANGS)
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_offers_commands_options_choices_and_files(script, tmp_path, monkeypatch):
    bash = script("bash")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "machine.csv").touch()
    assert completed(bash, "") >= set(COMMANDS)
    assert completed(bash, "dia") == {"diagnose"}
    assert {"--model", "--out", "--no-search"} <= completed(bash, "diagnose", "--")
    assert "machine.csv" in completed(bash, "inspect", "mach")
    assert "machine.csv" in completed(bash, "diagnose", "x.csv", "--model", "mach")


@pytest.mark.parametrize("shell", ["zsh", "tcsh"])
def test_other_shells_have_all_commands(script, shell):
    text = script(shell)
    assert [name for name in COMMANDS if name not in text] == []


def test_a_shell_that_is_not_known_is_one_line(capsys):
    with pytest.raises(SystemExit) as ending:
        main(["--print-completion", "cmd"])
    assert ending.value.code == 2
    assert "`--print-completion` must be one of bash, zsh, tcsh, but is 'cmd'" in capsys.readouterr().err


def test_without_shtab_the_extra_is_named(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as ending:
        main(["--print-completion", "bash"])
    assert ending.value.code == 2
    told = capsys.readouterr().err
    assert "pip install 'backlash-cosim[completion]'" in told
    assert told.count("\n") == 1
