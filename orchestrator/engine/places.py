"""Which place a sweep runs at, as its options say."""

from orchestrator.engine.pools import LocalProcesses, OpenPool, Tls
from orchestrator.errors import ScenarioError


def choose_pool(workers: int | None, scheduler: str | None, tls: Tls | None = None) -> OpenPool:
    """Return where to run: the Dask cluster at ``scheduler`` when given, else processes of this machine."""
    encrypted = (scheduler or "").startswith("tls://")
    if encrypted and tls is None:
        text = "`tls_ca`, `tls_cert` and `tls_key` must be given with a `scheduler` at tls://, but are not"
        raise ScenarioError(text, "tls_ca", "tls_cert", "tls_key", "scheduler")
    if tls is not None and not encrypted:
        text = f"`scheduler` must be tls://HOST:PORT with `tls_ca`, but is {scheduler!r}"
        raise ScenarioError(text, "scheduler", "tls_ca")
    if scheduler is None:
        return LocalProcesses(workers)
    if workers is not None:
        text = "`workers` must not be given with `scheduler`: the cluster has its own workers"
        raise ScenarioError(text, "workers", "scheduler")
    try:
        from orchestrator.engine.cluster import DaskCluster
    except ImportError:
        text = "`scheduler` needs the extra [dask]: pip install 'backlash-cosim[dask]'"
        raise ScenarioError(text, "scheduler") from None
    return DaskCluster(scheduler, tls)
