"""The engine as a program: kill -9 and resume, Ctrl-C, a full disk, memory."""

import os
import random
import signal

import pytest

from tests.support import engine_process
from tests.support.waiting import HANGS

LONG = 0.1  # s per case: a run that is disturbed is far from its end, however late this process sees where it stands


def undisturbed(tmp_path, cases):
    process = engine_process.start(tmp_path / "calm", cases, 0.0, 2)
    _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 0, errors
    return (tmp_path / "calm" / "table.csv").read_bytes()


def finish(directory, cases):
    process = engine_process.start(directory, cases, 0.0, 2, "--resume")
    _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 0, errors
    return (directory / "table.csv").read_bytes()


def test_killed_again_and_again_it_ends_with_the_same_bytes(tmp_path):
    dice = random.Random(5)
    directory = tmp_path / "killed"
    before = 0
    for _ in range(3):
        process = engine_process.start(directory, 200, LONG, 2, "--resume")
        engine_process.wait_for_cases(process, directory, before + dice.randint(1, 30))
        workers = engine_process.children(process.pid)
        process.kill()
        process.communicate()
        engine_process.wait_until_gone(workers)
        assert engine_process.finished_cases(directory) > before
        before = engine_process.finished_cases(directory)
    assert finish(directory, 200) == undisturbed(tmp_path, 200)


def test_killing_workers_while_it_runs_changes_nothing(tmp_path):
    directory = tmp_path / "out"
    process = engine_process.start(directory, 60, LONG, 2)
    for goal in (3, 15):
        engine_process.wait_for_cases(process, directory, goal)
        os.kill(engine_process.children(process.pid)[0], signal.SIGKILL)
    _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 0, errors
    assert (directory / "table.csv").read_bytes() == undisturbed(tmp_path, 60)


def test_ctrl_c_stops_at_once_keeps_what_is_done_and_says_how_to_go_on(tmp_path):
    directory = tmp_path / "out"
    process = engine_process.start(directory, 4000, 0.3, 2)  # ten minutes, if it went on
    engine_process.wait_for_cases(process, directory, 3)
    workers = engine_process.children(process.pid)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 130
    done = engine_process.finished_cases(directory)
    assert done < 1000
    assert errors == f"{done} of 4000 cases are kept: go on with `resume`\n"
    engine_process.wait_until_gone(workers)
    assert not (directory / "table.csv").exists()


def test_a_full_disk_keeps_what_is_done(tmp_path):
    directory = tmp_path / "out"
    process = engine_process.start(directory, 200, 0.0, 2, "--file-limit", "6000")
    _, errors = process.communicate(timeout=HANGS)
    assert process.returncode == 1
    done = engine_process.finished_cases(directory)
    assert 10 < done < 200
    assert f"File too large; {done} of 200 cases are kept: make room and go on with `resume`" in errors
    assert len(errors.splitlines()) == 1
    assert finish(directory, 200) == undisturbed(tmp_path, 200)


@pytest.mark.slow
@pytest.mark.parametrize("most", [2000, pytest.param(10_000, marks=pytest.mark.night)])
def test_memory_does_not_grow_with_the_number_of_cases(tmp_path, most):
    peaks = []
    for count in (100, most):
        process = engine_process.start(tmp_path / str(count), count, 0.0, 2)
        output, errors = process.communicate(timeout=HANGS)
        assert process.returncode == 0, errors
        peaks.append(int(output))
    assert peaks[1] <= 1.2 * peaks[0]
