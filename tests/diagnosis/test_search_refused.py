"""Sizes that no machine has are refused, and said."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, fit
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.search.plausible import implausible
from orchestrator.diagnosis.search.scene import scene_of
from orchestrator.plants.effects import Scene
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, axis_likelihood
from tests.support.small_search import FRICTION, PARTS, SEARCH, search_of


@pytest.mark.parametrize(("middle", "rest", "refused"), [(0.0, 3.0, False), (0.0, 7.0, True), (100.0, 103.0, False)])
def test_a_spring_at_rest_beyond_the_travel_is_a_constant_torque(middle: float, rest: float, refused: bool) -> None:
    """The load travels 2 pi, seen from an encoder whose zero may be far away."""
    law = next(effect for effect in DRIVETRAIN.bank if effect.label == "spring_load@load")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, middle - np.pi, middle + np.pi)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["angle"]] = rest
    assert bool(implausible(DRIVETRAIN, law, p, scene, SEARCH)) is refused


def test_a_size_that_no_machine_has_is_refused_and_said_once() -> None:
    likelihood, p = axis_likelihood()
    search = search_of(likelihood)
    scene = scene_of(likelihood, fit(likelihood, likelihood.nominal, 0.01, (), PARTS))
    place = AXIS.index("effects.coulomb_friction.motor.torque")

    def of_size(torque: float) -> Candidate:
        sized = p.copy()
        sized[place] = torque
        found = Fit(sized, 1e-5, np.zeros((1, 1)), (), np.zeros((0, 0)), 0.0, 0.0)
        return Candidate((FRICTION,), found, SEARCH)

    small, large, larger = of_size(0.1), of_size(1e4), of_size(2e4)
    assert search.possible([large, small], scene) == [small]
    assert list(search.refused) == [FRICTION.label]
    assert "1e+04 N.m is more than the drive's largest torque" in search.refused[FRICTION.label]
    assert search.possible([larger], scene) == []
    assert "1e+04" in search.refused[FRICTION.label]
    search.refused.clear()
    none = replace(small, effects=())
    assert search.possible([large], scene, none) == []
    assert search.refused == {}  # it gains nothing: nobody would have named it
    gains = replace(large, fit=replace(large.fit, fitted=100.0, validated=50.0))
    assert search.possible([gains], scene, none) == []
    assert list(search.refused) == [FRICTION.label]


@pytest.mark.parametrize(("lag", "refused"), [(0.9, False), (90.0, True)])
def test_a_drive_that_is_slower_than_any_is_refused(friction, lag, refused) -> None:
    search, _, base, _, _ = friction
    slow = next(effect for effect in AXIS.bank if effect.name == "drive_filter")
    p = base.fit.p.copy()
    p[slow.places(AXIS)["time_constant"]] = lag
    why = implausible(AXIS, slow, p, scene_of(search.likelihood, base.fit), SETTINGS.search)
    assert ("too slow for a drive" in why) is refused


@pytest.mark.parametrize(("seconds", "refused"), [(0.5, False), (5.0, True)])
def test_a_drive_whose_torque_takes_seconds_to_rise_is_refused(friction, seconds: float, refused: bool) -> None:
    search, _, base, _, _ = friction
    limit = next(effect for effect in AXIS.bank if effect.name == "rate_limit")
    scene = scene_of(search.likelihood, base.fit)
    p = base.fit.p.copy()
    p[limit.places(AXIS)["rate"]] = np.max(np.abs(scene.u)) / seconds
    assert ("too slow for a drive" in implausible(AXIS, limit, p, scene, SETTINGS.search)) is refused


@pytest.mark.parametrize(
    ("ratio", "refused"), [(0.6, ""), (0.8, "no peak: no resonance"), (1e-3, ""), (1e-4, "never come to rest")]
)
def test_a_resonance_without_a_peak_or_without_damping_is_none(ratio: float, refused: str) -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.name == "extra_resonance")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["damping_ratio"]] = ratio
    why = implausible(DRIVETRAIN, law, p, scene, SEARCH)
    assert why.endswith(refused) if refused else not why


@pytest.mark.parametrize(("times", "refused"), [(0.7, True), (0.8, False)])
def test_a_wave_that_comes_round_no_more_than_it_must_is_none(times: float, refused: bool) -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.name == "torque_ripple")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["cycles_per_rev"]] = times / scene.turns
    assert ("no wave" in implausible(DRIVETRAIN, law, p, scene, SEARCH)) is refused


@pytest.mark.parametrize(("stiffness", "refused"), [(2.0, True), (20.0, False)])
def test_a_stop_that_gives_way_is_none(stiffness: float, refused: bool) -> None:
    """The load's travel ends 0.1 rad beyond the stop; the drive has 4 N.m at the load."""
    stop = next(effect for effect in DRIVETRAIN.bank if effect.name == "lower_end_stop")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    places = stop.places(DRIVETRAIN)
    p[places["angle"]], p[places["stiffness"]] = -0.9, stiffness
    assert ("no stop" in implausible(DRIVETRAIN, stop, p, scene, SEARCH)) is refused


@pytest.mark.parametrize(
    ("angles", "refused"),
    [((-1.0, -1.0, 0.0, 1.0), True), ((-1.0, 0.0, 1.0, -1.0), False), ((0.0, 1.0, -1.0, 0.0), False)],
)
def test_a_stop_that_is_touched_as_a_record_begins_alone_is_none(angles: tuple[float, ...], refused: bool) -> None:
    stop = next(effect for effect in DRIVETRAIN.bank if effect.name == "lower_end_stop")
    scene = Scene(0.01, 1.0, np.ones(4), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0, angles=np.array(angles))
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    places = stop.places(DRIVETRAIN)
    p[places["angle"]], p[places["stiffness"]] = -0.9, 20.0
    assert ("never again" in implausible(DRIVETRAIN, stop, p, scene, SEARCH)) is refused


@pytest.mark.parametrize(("coefficient", "refused"), [(0.3, False), (1.0, True)])
def test_friction_that_takes_all_that_is_transmitted_is_none(coefficient: float, refused: bool) -> None:
    law = next(effect for effect in DRIVETRAIN.bank if effect.label == "load_dependent_friction@motor")
    scene = Scene(0.01, 1.0, np.ones(3), 1.0, 1.0, 0.1, 1.0, 1.0, 4.0, 4.0, -1.0, 1.0)
    p = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p[law.places(DRIVETRAIN)["coefficient"]] = coefficient
    assert ("holds itself" in implausible(DRIVETRAIN, law, p, scene, SEARCH)) is refused
