"""The answer of a diagnosis in words: every effect has some, and nothing open goes without an experiment."""

from types import SimpleNamespace

import pytest

from orchestrator.diagnosis.outcome import Misfit, Named, ParameterEstimate
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.verdict.remainder import Predictable, Remainder
from orchestrator.diagnosis.verdict.told import COLD_AND_WARM, MOTION, REPEAT, SETTLES, in_words, told
from orchestrator.plants.known import plants

FRICTION = Named(
    "coulomb_friction", "motor", {"torque": ParameterEstimate(0.8, 0.01, (0.78, 0.82), "N.m")}, 100.0, "", 100.0
)


def diagnosis(verdict, effects=(), suspects=(), after=1.0, left=None, warnings=()):
    stages = (("nominal", 50.0), ("parameters", 40.0), *((f"+ {e.name}@{e.site}", after) for e in effects))
    return SimpleNamespace(
        verdict=verdict,
        effects=effects,
        suspects=suspects,
        misfit=(Misfit("theta_m", "rad", 1.0, stages if effects else (("nominal", after),)),),
        remainder=left or Remainder(0.0, 1.0, 1.0, ()),
        settings=DiagnosisSettings(),
        play=None,
        warnings=warnings,
        nuisances=(),
    )


def lines(*args, **kwargs) -> list[str]:
    return list(told(diagnosis(*args, **kwargs)))


def test_every_effect_that_can_be_named_says_what_it_does() -> None:
    names = {effect.name for plant in plants().values() for effect in plant.bank if not effect.measurement}
    assert names - set(MOTION) == set()


def test_an_effect_is_said_with_size_certainty_and_what_it_does() -> None:
    said = lines("effects", (FRICTION,))
    assert said[0] == "Verdict: effects. The model lacks Coulomb friction at the motor."
    assert said[1] == "  Coulomb friction at the motor: torque 0.8 +- 0.01 N.m"
    assert "gain in log-likelihood 100; nothing else came near" in said[2]
    assert "adding it takes the misfit of the motor from 40 to 1 rad" in said[3]
    assert said[4].endswith("the motor 1 rad, 1 times its encoder's noise: explained.")
    assert len(said) == 5


def test_what_cannot_be_told_apart_is_said_with_the_experiment_that_would() -> None:
    alike = Named("coulomb_friction", "motor", {}, 100.0, "", 1.0, ("coulomb_friction@motor", "coulomb_friction@load"))
    said = lines("effects", (alike,))
    assert any("may as well be Coulomb friction at the load" in line for line in said)
    assert said[-1] == f"Would settle what is open: {SETTLES['speed']}."


@pytest.mark.parametrize(
    ("left", "experiment"),
    [
        (Remainder(9.0, 0.1, 1.0, ()), REPEAT),
        (Remainder(9.0, 0.1, 9.0, ()), COLD_AND_WARM),
        (Remainder(9.0, 0.1, 1.0, (Predictable("shaft", "twist memory", 99.0, 0.5),)), SETTLES["twist memory"]),
    ],
)
def test_an_unexplained_rest_is_called_that(left, experiment) -> None:
    said = lines("unknown", suspects=(FRICTION,), left=left)
    assert "Nearest came Coulomb friction at the motor, too little to be named" in said[0]
    assert "This is unexplained: it " in said[1]
    assert experiment in said[2]


def test_a_large_misfit_of_free_runs_is_not_passed_over() -> None:
    assert lines("parameters", after=2.9)[1].endswith("explained.")
    assert "is unexplained" in lines("parameters", after=3.1)[1]
    assert len(lines("none")) == 2


def test_evidence_that_is_left_is_not_called_explained() -> None:
    said = lines("effects", (FRICTION,), warnings=("27 % of the misfit's evidence is left; it follows the speed",))
    assert "not all is explained: 27 % of the misfit's evidence is left" in said[-1]
    assert not said[-1].endswith(": explained.")


def test_words_of_a_site() -> None:
    assert in_words("input_delay@actuator") == "input delay in the drive"
    assert in_words("stribeck_friction@load") == "Stribeck friction at the load"
    assert in_words("shaft_hysteresis@shaft") == "shaft hysteresis"
