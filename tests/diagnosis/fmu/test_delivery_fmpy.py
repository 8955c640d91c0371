"""The corrected system in FMPy's own SSP simulation, which runs all FMUs side by side."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.fmu.corrected_ssp import effect_parts, write_corrected
from tests.support.box_fmu import DOMAINS, write_fmu, write_map
from tests.support.box_records import record, write_record
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="no C compiler")
FINER = 8  # steps of FMPy in one of the fit: side by side, the loop sees older values


def test_fmpy_reproduces_the_fit_within_a_tenth_of_the_noise(tmp_path):
    from fmpy.ssp.simulation import simulate_ssp

    domain = DOMAINS[0]
    case = record(domain, ("quadratic_drag",), np.random.default_rng(4), 400)
    fmu = write_fmu(tmp_path / "Spring.fmu", domain)
    found = diagnose(
        write_record(tmp_path / "r.csv", case),
        fmu,
        write_map(tmp_path / "m.toml", domain),
        effects=["quadratic_drag@port"],
    )
    try:
        workings = found.diagnosis.workings
        problem, model = workings.problem, workings.final
        assert [effect.name for effect in found.effects] == ["quadratic_drag"]
        path = tmp_path / "corrected.ssp"
        write_corrected(path, problem, model)
        fitted = problem.simulate([model])[0]
        coarse = problem.h / problem.m
        step = coarse / FINER
        held = problem.plain_table()[:, 0]
        values = [
            SimpleNamespace(name=f"plant.{u.name}", value=v)
            for u, v in zip(problem.map.uncertain, model.p, strict=True)
        ]
        for part in effect_parts(problem, model):
            given = part.values | {"lead": 1.5}
            given.pop("has_velocity")
            values += [SimpleNamespace(name=f"{part.name}.{name}", value=value) for name, value in given.items()]

        def ahead(time):
            """The input two steps early: FMPy hands values on after a step, twice on the way to the plant."""
            place = int((time + 2 * step) / coarse + 1e-6)
            return float(held[min(place, len(held) - 1)])

        stop = float(problem.data.time[-1])
        rows = simulate_ssp(str(path), 0.0, stop, step, SimpleNamespace(parameters=values), {"F_in": ahead})
        y = rows["plant.x"][problem.m * FINER - 1 :: problem.m * FINER]
        count = min(len(y), len(fitted) - 1)
        rms = np.sqrt(np.mean((y[:count] - fitted[1 : count + 1, 0]) ** 2))
        assert rms / problem.noise[0] < 0.1
    finally:
        found.close()
