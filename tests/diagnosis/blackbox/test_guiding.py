"""Guided runs: they say what free runs say of linear FMUs, and stay with the record where those go astray."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.diagnose import behind, fitters, prepared
from orchestrator.diagnosis.blackbox.guiding import guided
from orchestrator.diagnosis.blackbox.held_out import held_out
from orchestrator.diagnosis.blackbox.mapping import read_map
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import parts_of
from orchestrator.diagnosis.blackbox.reading import read_data
from orchestrator.diagnosis.blackbox.settings import DEFAULT
from orchestrator.diagnosis.blackbox.subject import subject_of
from tests.support.box_fmu import DOMAINS, record, write_fmu, write_map, write_record
from tests.support.c_fmu import have_compiler

needs_compiler = pytest.mark.skipif(not have_compiler(), reason="no C compiler")
SPRING, _, _, TANKS = DOMAINS


@pytest.fixture
def opened(tmp_path):
    problems = []

    def open_(domain, names=(), **options):
        case = record(domain, names, np.random.default_rng(5), 500, **options)
        subject = subject_of(write_fmu(tmp_path / "a.fmu", domain))
        given = read_map(write_map(tmp_path / "map.toml", domain), subject)
        data = read_data(write_record(tmp_path / "record.csv", case), given)
        problem, _ = prepared(subject, given, data, 1)
        problems.append(problem)
        return problem, BoxModel(np.array(case.parameters))

    yield open_
    for problem in problems:
        problem.runner.close()


@needs_compiler
def test_a_guided_run_of_a_linear_fmu_is_as_likely_as_a_free_one(opened):
    problem, _ = opened(SPRING)
    led = guided(problem)
    both = [(p, fitters(p, parts_of(p.n))[0]) for p in (problem, led)]
    rows = slice(50, problem.n)  # the start: the guide takes the first residual for an old one
    for share, colour in ((1e-3, 0.0), (0.04, 0.0), (0.04, 0.7), (0.3, 0.9)):
        told = []
        for p, fitter in both:
            k = next(
                k
                for k in range(fitter.ladder.size)
                if (fitter.ladder.share(k), fitter.ladder.colour(k)) == (share, colour)
            )
            told.append(fitter.likelihood(fitter.whitened(p.must_simulate(p.nominal), k), k, rows))
        assert told[1] == pytest.approx(told[0], rel=0.02)


@needs_compiler
def test_a_guided_run_stays_with_the_record_whatever_the_inertia(opened):
    problem, _ = opened(SPRING, ("unknown_coming_load",))
    led = guided(problem)
    off = [np.std(p.residual(p.must_simulate(p.nominal))[-100:]) for p in (problem, led)]
    assert off[1] < 0.2 * off[0]
    heavy = BoxModel(problem.nominal.p * np.array([4.0, 1.0, 1.0]))
    _, late = (np.std(led.residual(led.must_simulate(m))[-100:]) for m in (led.nominal, heavy))
    assert np.isfinite(late)
    gains = [tuple(map(float, led._gains([led._plan(m, None)])[0][0])) for m in (led.nominal, heavy)]
    assert gains[1] == pytest.approx(np.multiply(gains[0], 4.0), rel=0.02)


@needs_compiler
def test_a_guided_run_keeps_the_time_of_an_fmu_with_a_clock_of_its_own(opened):
    problem, _ = opened(SPRING)
    problem.short, problem.late = 1e-9, 3e-4
    led = guided(problem)
    assert (led.step, led.late) == (problem.step, problem.late)
    assert led.step < problem.h / problem.m


@needs_compiler
def test_a_store_is_led_by_its_level_alone(opened):
    led = guided(opened(TANKS, ("input_saturation",))[0])
    assert [pull.massive for pull in led.pulls] == [False]
    assert led._gains([led._plan(led.nominal, None)])[0][0][1] == 0.0


@needs_compiler
def test_without_a_measured_position_there_is_no_guide(opened):
    problem, _ = opened(SPRING)
    problem.map = msgspec.structs.replace(problem.map, ports={})
    assert guided(problem) is None


@needs_compiler
def test_friction_beside_a_large_disturbance_is_named_by_what_it_does_to_unseen_data(tmp_path):
    case = record(SPRING, ("coulomb_friction",), np.random.default_rng(4), 900, disturbance=0.06)
    found = diagnose(
        write_record(tmp_path / "record.csv", case),
        write_fmu(tmp_path / "a.fmu", SPRING),
        write_map(tmp_path / "map.toml", SPRING),
    )
    (tmp_path / "out").mkdir()
    found.write_files(tmp_path / "out")
    found.close()
    assert found.verdict == "effects"
    assert [f.name for f in found.effects] == ["coulomb_friction"]
    low, high = found.effects[0].estimates[0].interval
    assert low < case.sizes[0] < high
    assert found.trust.level.word == "amber"
    assert any("data not fitted" in str(reason) for reason in found.trust.reasons)
    assert found.delivered[0].difference < 0.1


def _held_out(before, after, nominal=None):
    y = 100.0 * np.sin(np.arange(200.0))[:, None]
    problem = SimpleNamespace(residual=lambda run: run - y, data=SimpleNamespace(outputs=y), noise=np.ones(1))
    runs = [y + np.where(np.arange(200)[:, None] % 2, 1.0, -1.0) * off for off in (nominal or before, before, after)]
    return held_out(problem, runs, slice(0, 200), DEFAULT.rest)


def test_effects_show_where_they_remove_nine_tenths_of_the_squared_misfit():
    assert _held_out(20.0, 5.0).shows(DEFAULT.rest)
    assert not _held_out(20.0, 8.0).shows(DEFAULT.rest)
    assert not _held_out(20.0, 5.0, nominal=8.0).shows(DEFAULT.rest)  # the model as it was given is as good
    assert _held_out(1.0, 1.0).removed == 1.0  # nothing was missing there
    assert _held_out(1.3, 1.1).removed == 1.0  # nor is it with the effects
    assert _held_out(4.4, 4.0).removed < DEFAULT.rest.least_shown


def test_effects_that_do_not_follow_the_motion_do_not_show():
    assert not _held_out(400.0, 40.0).shows(DEFAULT.rest)


@pytest.mark.parametrize(
    ("name", "family"), [("input_delay", ("output_delay@x", "output_delay@y")), ("input_saturation", ())]
)
def test_a_delay_that_guided_runs_name_may_lie_behind_the_fmu(name, family):
    effect = BoxEffect(BANK[name], "u", Surroundings(0.01, 1.0, 1.0, np.ones(3)))
    assert behind(effect, ("load@p",), ("x", "y")) == ("load@p", *family)
