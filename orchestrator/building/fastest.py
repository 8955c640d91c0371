"""Which build of our FMUs runs here: native where that is possible and gives the bits of the Python FMUs, else Python.

The bits are compared on this machine before a native build is first used: each is stepped beside the Python slave that
it was translated from, with the same inputs, through every backlash model.
"""

import contextlib
import hashlib
import platform
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.building.build import ensure_built
from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_build import ensure_native
from orchestrator.building.native_sources import slave_class
from orchestrator.building.sources import recipe_of, recipes_of
from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.instances import make_slave
from orchestrator.shared.cache import cache_directory
from orchestrator.shared.isolation.archives import content_hash

NATIVE = "native"
PYTHON = "Python"
PROBE_STEPS = 60
"""Steps of each comparison: enough for several contacts at the probe's inputs."""
_PROBE_STEP = 1e-3
_PROBE_STARTS = {"alpha": 0.002, "theta_m_start": 0.02}


@dataclass(frozen=True)
class FmuBuilds:
    """Built FMUs."""

    paths: Mapping[str, Path]
    kind: str


def ensure_fastest(names: Sequence[str], meanwhile: Callable[[], object] | None = None) -> FmuBuilds:
    """Return our FMUs as they run fastest on this machine with the bits of the Python FMUs."""
    if find_compiler(here=True) is not None:
        with contextlib.suppress(FmuError):  # whatever a compiler lacks, the Python FMUs are there
            folder = cache_directory("native")
            with ThreadPoolExecutor(len(names)) as pool:  # each waits for a compiler most of its time
                each = [[recipe.name] for recipe in recipes_of(names)]  # the catalogue is read before they begin
                built = pool.map(partial(ensure_native, directory=folder, here=True, versions=True), each)
                if meanwhile is not None:
                    pool.submit(meanwhile)  # once a thread is free: all are translated by then
            paths = {name: path for found in built for name, path in found.items()}
            if all(same_bits(name, path) for name, path in paths.items()):
                return FmuBuilds(paths, NATIVE)
    return FmuBuilds(ensure_built(names), PYTHON)


def same_bits(name: str, path: Path) -> bool:
    """Return whether a native FMU gives the bits of its Python slave here; a comparison that held is remembered."""
    place = (content_hash(path), sys.version, platform.platform(), *platform.libc_ver(), platform.processor())
    mark = cache_directory("same_bits") / hashlib.sha256("\n".join(place).encode()).hexdigest()[:32]
    if mark.exists():
        return True
    cls = slave_class(recipe_of(name))
    models = [v for v in cls.table if v.causality == "parameter" and v.type == "Enumeration"]
    variants: list[dict[str, Any]] = [{v.name: n} for v in models[:1] for n in range(1, int(v.bounds[1]) + 1)]
    if not all(_agree(name, cls, path, variant) for variant in variants or [{}]):
        return False
    with contextlib.suppress(OSError):
        mark.touch()
    return True


def _agree(name: str, cls: Any, path: Path, variant: Mapping[str, Any]) -> bool:
    rng = random.Random(0)
    places = {v.name: n for n, v in enumerate(cls.table)}
    of = {c: [v for v in cls.table if v.causality == c and v.type == "Real"] for c in ("input", "output", "parameter")}
    matrices = {v.name: rng.uniform(-0.4, 0.4) for v in of["parameter"] if "[" in v.name}
    starts = {**matrices, **{k: v for k, v in _PROBE_STARTS.items() if k in places}, **variant}
    python, native = cls(), make_slave(name, path)
    try:
        native.set(starts)
        for key, value in starts.items():
            (python.set_integer if key in variant else python.set_real)([places[key]], [value])
        native.begin(0.0, None, None)
        python.setup_experiment(0.0)
        python.enter_initialization_mode()
        native.start()
        python.exit_initialization_mode()
        inputs, outputs = np.zeros(len(of["input"])), np.zeros(len(of["output"]))
        send = native.sends([v.name for v in of["input"]], inputs)
        receive = native.receives([v.name for v in of["output"]], outputs)
        for n in range(PROBE_STEPS):
            inputs[:] = [rng.uniform(-20.0, 20.0) for _ in inputs]
            python.set_real([places[v.name] for v in of["input"]], inputs.tolist())
            send()
            native.do_step(n * _PROBE_STEP, _PROBE_STEP)
            receive()
            taken = python.do_step(n * _PROBE_STEP, _PROBE_STEP)
            mine = np.array(python.get_real([places[v.name] for v in of["output"]]))
            if not taken or mine.tobytes() != outputs.tobytes():
                return False
    except SlaveError:
        return False
    finally:
        native.close()
    return True
