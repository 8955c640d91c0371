"""The engine on a Dask cluster over TCP: the same bytes, whoever dies."""

import asyncio
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.engine import CaseLimits, DesignCases, LocalProcesses, choose_pool, run_cases, write_csv
from orchestrator.engine.grid import Listed, Product, Ranged
from orchestrator.errors import ScenarioError, SimulationError
from tests.support import engine_work
from tests.support.dask_cluster import DaskProcesses

pytest.importorskip("distributed", reason="the extra [dask] is not installed")
from distributed.utils import LoopRunner

from orchestrator.engine import cluster as cluster_module
from orchestrator.engine import loop

CASES = DesignCases(Ranged("size", 0.0, 2.0, 150), seed=3)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    with DaskProcesses(tmp_path_factory.mktemp("dask"), workers=2) as processes:
        yield processes


def work_with_file():
    return replace(engine_work.work(wait=0.01), files={"blob": Path(__file__)})


def table(directory, open_pool, cases=CASES, work=None, **options):
    with run_cases(cases, work or work_with_file(), directory / "j", open_pool=open_pool, **options) as sweep:
        write_csv(directory / "t.csv", cases.names, sweep.columns, sweep.rows())
        sweep.discard_journal()
    return (directory / "t.csv").read_bytes()


@pytest.fixture(scope="module")
def local_bytes(tmp_path_factory):
    return table(tmp_path_factory.mktemp("local"), LocalProcesses(2))


def test_a_cluster_returns_the_same_bytes_as_this_machine(tmp_path, cluster, local_bytes):
    assert table(tmp_path, choose_pool(None, cluster.address)) == local_bytes


def test_a_dask_worker_that_is_killed_in_the_middle_changes_nothing(tmp_path, cluster, local_bytes):
    killed = []

    def kill(progress):
        if progress.done > 30 and not killed:
            killed.append(progress.done)
            cluster.kill_worker(0)

    assert table(tmp_path, choose_pool(None, cluster.address), on_progress=kill) == local_bytes
    assert killed
    assert killed[0] < len(CASES)


def test_faults_become_rows_on_a_cluster_too(tmp_path, cluster):
    cases = DesignCases(Product((Listed("fault", ("hangs", "crashes", "nan", "none")), Listed("size", (1.0,)))), seed=1)
    work = engine_work.work(engine_work.run_faulty)
    text = table(tmp_path, choose_pool(None, cluster.address), cases, work, limits=CaseLimits(time=5.0)).decode()
    assert [line.split(",")[3] for line in text.splitlines()[1:]] == ["time_limit", "crash", "non_finite", "done"]


def test_a_dead_scheduler_keeps_what_is_done(tmp_path, local_bytes):
    with DaskProcesses(tmp_path, workers=1) as cluster:

        def kill(progress):
            if progress.done > 30:
                cluster.kill_scheduler()

        with pytest.raises(SimulationError, match=r"of 150 cases are kept: go on with `resume`"):
            table(tmp_path, choose_pool(None, cluster.address), on_progress=kill)
    resumed = []
    assert table(tmp_path, LocalProcesses(2), resume=True, on_progress=resumed.append) == local_bytes
    assert resumed[0].resumed > 30


def test_a_scheduler_that_is_not_there_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("orchestrator.engine.cluster.CONNECT_LIMIT", 2.0)
    with pytest.raises(ScenarioError, match=r"`scheduler` must be a Dask scheduler, but 'tcp://127\.0\.0\.1:9' is not"):
        table(tmp_path, choose_pool(None, "tcp://127.0.0.1:9"))
    with pytest.raises(ScenarioError, match="but 'nonsense' is not"):
        table(tmp_path, choose_pool(None, "nonsense"))
    assert list(tmp_path.iterdir()) == []


def test_workers_and_scheduler_exclude_each_other():
    with pytest.raises(ScenarioError, match="must not be given with"):
        choose_pool(2, "tcp://127.0.0.1:9")


def test_workers_of_another_version_are_refused(tmp_path, cluster, monkeypatch):
    monkeypatch.setattr("orchestrator.engine.cluster.__version__", "9.9.9")
    with pytest.raises(ScenarioError, match=r"must run version 9\.9\.9, but tcp://\S+ has"):
        table(tmp_path, choose_pool(None, cluster.address))


def test_a_scheduler_that_is_slow_gets_another_try(tmp_path, cluster, local_bytes, monkeypatch):
    tries = []

    class Slow(cluster_module.Client):
        def __init__(self, *words, **options):
            tries.append(words)
            if len(tries) == 1:
                raise TimeoutError("Timed out trying to connect")
            super().__init__(*words, **options)

    monkeypatch.setattr(cluster_module, "Client", Slow)
    assert table(tmp_path, choose_pool(None, cluster.address)) == local_bytes
    assert len(tries) == 2


def test_the_event_loop_is_waited_for_however_long_it_takes(tmp_path, cluster, local_bytes, monkeypatch):
    """The client's own wait for a loop of its own ends in an assertion; ours must not come there."""

    def started(runner):
        assert runner._loop is not None, "the client would start a loop, and wait for it by the clock"
        own(runner)

    own = LoopRunner._start_unlocked
    monkeypatch.setattr(LoopRunner, "_start_unlocked", started)
    late = loop.LoopThread._main

    async def slow(self):
        await asyncio.sleep(0.5)
        await late(self)

    monkeypatch.setattr(loop.LoopThread, "_main", slow)
    assert table(tmp_path, choose_pool(None, cluster.address)) == local_bytes
    assert not [thread for thread in threading.enumerate() if thread.name == "cluster loop"]


def test_a_scheduler_that_does_not_answer_is_asked_again(tmp_path, cluster, local_bytes, monkeypatch):
    asked = []
    threads = cluster_module.Client.nthreads

    def nthreads(client):
        asked.append(client)
        if len(asked) == 2:
            raise OSError("Timed out during handshake")
        return threads(client)

    monkeypatch.setattr(cluster_module.Client, "nthreads", nthreads)
    monkeypatch.setattr(cluster_module, "SLOTS_AGE", 0.0)
    assert table(tmp_path, choose_pool(None, cluster.address)) == local_bytes
    assert len(asked) > 2
