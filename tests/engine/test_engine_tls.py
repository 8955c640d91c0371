"""A cluster over TLS: the right certificate works, a wrong one or none is refused, and the table is the same."""

import shutil
import subprocess
from pathlib import Path

import pytest

from orchestrator.engine import DesignCases, LocalProcesses, Tls, choose_pool, choose_tls, run_cases, write_csv
from orchestrator.engine.grid import Ranged
from orchestrator.errors import ScenarioError
from tests.support import engine_work
from tests.support.dask_cluster import DaskProcesses

pytest.importorskip("distributed", reason="the extra [dask] is not installed")
pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="certificates are made with openssl")
CASES = DesignCases(Ranged("size", 0.0, 2.0, 20), seed=3)


def _openssl(folder: Path, *words: str) -> None:
    subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)


def certificates(folder: Path) -> Tls:
    """An authority of its own, and a certificate that it has signed."""
    folder.mkdir()
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    _openssl(folder, "req", "-x509", *curve, "-days", "2", "-keyout", "ca.key", "-out", "ca.pem", "-subj", "/CN=ca")
    _openssl(folder, "req", *curve, "-keyout", "key.pem", "-out", "request.pem", "-subj", "/CN=localhost")
    _openssl(folder, "x509", "-req", "-in", "request.pem", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
             "-days", "2", "-out", "certificate.pem")  # fmt: skip
    return Tls(folder / "ca.pem", folder / "certificate.pem", folder / "key.pem")


def table(folder: Path, open_pool) -> bytes:
    with run_cases(CASES, engine_work.work(), folder / "j", open_pool=open_pool) as sweep:
        write_csv(folder / "t.csv", CASES.names, sweep.columns, sweep.rows())
        sweep.discard_journal()
    return (folder / "t.csv").read_bytes()


def test_only_who_has_the_right_certificate_may_connect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right, wrong = certificates(tmp_path / "right"), certificates(tmp_path / "wrong")
    files = ["--tls-ca-file", str(right.authority), "--tls-cert", str(right.certificate), "--tls-key", str(right.key)]
    (tmp_path / "cluster").mkdir()
    with DaskProcesses(tmp_path / "cluster", 1, ["--protocol", "tls", *files]) as cluster:
        assert cluster.address.startswith("tls://")
        encrypted = table(tmp_path, choose_pool(None, cluster.address, right))
        monkeypatch.setattr("orchestrator.engine.cluster.CONNECT_LIMIT", 2.0)
        with pytest.raises(ScenarioError, match="must be a Dask scheduler"):
            table(tmp_path, choose_pool(None, cluster.address, wrong))
        with pytest.raises(ScenarioError, match="must be a Dask scheduler"):
            table(tmp_path, choose_pool(None, cluster.address.replace("tls://", "tcp://")))
    assert encrypted == table(tmp_path, LocalProcesses(1))


def test_the_options_belong_together(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    assert choose_tls(None, None, None) is None
    with pytest.raises(ScenarioError, match="`tls_key` must be given with the other two"):
        choose_tls(file, file, None)
    with pytest.raises(ScenarioError, match="`tls_cert` must be a readable file"):
        choose_tls(file, tmp_path / "none", file)
    with pytest.raises(ScenarioError, match="must be tls://HOST"):
        choose_pool(None, "tcp://127.0.0.1:9", Tls(file, file, file))
    with pytest.raises(ScenarioError, match="`tls_ca`, `tls_cert` and `tls_key` must be given"):
        choose_pool(None, "tls://127.0.0.1:9")
