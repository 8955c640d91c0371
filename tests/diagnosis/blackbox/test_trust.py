"""Trust in a diagnosis of any FMU, on results made by hand: what keeps it from green, one statement of what is left."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox import judged as outcome
from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect
from orchestrator.diagnosis.blackbox.estimates import FoundEffect, OutputMisfit, ValueEstimate
from orchestrator.diagnosis.blackbox.held_out import HeldOut
from orchestrator.diagnosis.blackbox.lawful import Dependence
from orchestrator.diagnosis.blackbox.rest import Rest
from orchestrator.diagnosis.blackbox.settings import BoxSearchSettings, RestSettings
from orchestrator.diagnosis.blackbox.trust import SECOND, UNEXPLAINED, doubts, harm, statement
from orchestrator.shared.trust import Level

SEARCH = BoxSearchSettings()
NOISE = Rest(True, False, 0.0, (), np.ones((8, 1)))
DISTURBED = replace(NOISE, explained=False, disturbed=True, share=1e-4)
LEFT = replace(NOISE, explained=False, reasons=("output `x`: comes in bursts",))
GOOD = OutputMisfit("phi", 1e-4, 50.0, 40.0, 1.02, "rad")
FRICTION = FoundEffect(SimpleNamespace(label="coulomb_friction@shaft"), (), 900.0, ())


def judged(verdict="effects", effects=(FRICTION,), rest=NOISE, held_out=(GOOD,), second=(), late=False, **settings):
    return doubts(verdict, effects, rest, held_out, second, late, RestSettings(**settings))


@pytest.mark.parametrize(("verdict", "effects"), [("none", ()), ("parameters", ()), ("effects", (FRICTION,))])
def test_what_leaves_noise_alone_is_green_and_says_so(verdict, effects):
    trust = judged(verdict, effects, second=(GOOD,))
    assert (trust.level, trust.reasons) == (Level.GREEN, ())
    assert statement(verdict, NOISE).endswith("the record to its noise")


def test_unknown_is_red_whatever_else_is_good():
    trust = judged("unknown", (), LEFT)
    assert (trust.level, trust.reasons) == (Level.RED, (UNEXPLAINED,))
    assert statement("unknown", LEFT) == UNEXPLAINED


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"effects": (replace(FRICTION, family=("load@shaft",)),)},
            "does not tell coulomb_friction@shaft from load@sha",
        ),
        ({"rest": DISTURBED}, "a disturbance of about 0.01 % of the drive"),
        ({"held_out": (replace(GOOD, corrected=2.07),)}, "misfit of `phi` on held-out data is 2.07 times its noise"),
        ({"second": (replace(GOOD, corrected=3.0),)}, "misfit of `phi` on the second record is 3 times its noise"),
        ({"held_out": (replace(GOOD, refitted=1.0, corrected=1.15),)}, "on held-out data `phi` is worse"),
        ({"second": (replace(GOOD, refitted=1.0, corrected=1.15),)}, "on the second record `phi` is worse"),
        ({"late": True}, "the search was cut short"),
    ],
)
def test_what_was_not_shown_is_amber_with_its_reason(change, words):
    trust = judged(**change)
    assert trust.level is Level.AMBER
    (reason,) = trust.reasons
    assert words in reason


def test_a_disturbance_is_part_of_the_statement():
    said = statement("effects", DISTURBED)
    assert said.endswith("explain the record but for a disturbance of about 0.01 % of the drive at the ports")
    assert "to its noise" not in said


def test_thresholds_are_those_of_the_settings():
    misfit = (replace(GOOD, corrected=2.07),)
    assert judged(held_out=misfit, notable_misfit=2.5).level is Level.GREEN
    worse = (replace(GOOD, refitted=1.0, corrected=1.15),)
    assert harm(worse, SECOND)
    assert not harm(worse, SECOND, RestSettings(worse=1.3))


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [([(3.0, 0.1), (1.0, 0.3)], 1), ([(3.0, 0.1), (-1.3, 0.3)], None), ([(0.1, 0.2), (0.1, 0.2)], 0), ([], None)],
)
def test_an_effect_whose_size_may_be_zero_is_found(sizes, expected):
    effects = [SimpleNamespace(kind=SimpleNamespace(finer=None, name="load"), amplitudes=1) for _ in sizes]
    values = [(ValueEstimate("size", value, error, (0.0, 0.0), "N"),) for value, error in sizes]
    assert outcome._of_no_size(SimpleNamespace(model=SimpleNamespace(effects=effects)), values, SEARCH) == expected


@pytest.mark.parametrize(("error", "expected"), [(0.011, 0), (0.001, None)])
def test_a_ripple_whose_wavenumber_is_hardly_known_need_not_repeat(error, expected):
    ripple = SimpleNamespace(kind=SimpleNamespace(finer=None, name="ripple"), amplitudes=2)
    sizes = ((-6.4, 0.3), (-0.4, 0.3), (0.045, error))
    values = [tuple(ValueEstimate("size", value, of, (0.0, 0.0), "N") for value, of in sizes)]
    assert outcome._of_no_size(SimpleNamespace(model=SimpleNamespace(effects=(ripple,))), values, SEARCH) == expected


SHOWN = HeldOut(0.99, 0.999, 0.99)


def _told(monkeypatch, labels, error, refuted, law=None):
    effects = [BoxEffect(BANK[name.partition("@")[0]], name, None) for name in labels]
    search = SimpleNamespace(fitter=SimpleNamespace(mean=np.ones(1), sd=np.ones(1)), settings=SEARCH)
    last = SimpleNamespace(model=SimpleNamespace(effects=effects, p=np.ones(1)))
    values = [(ValueEstimate("size", 1.0, error, (0.0, 0.0), "N"),) * 2 for _ in labels]
    monkeypatch.setattr(outcome, "dependence_of", lambda *_: law)
    return outcome._verdict(search, last, values, LEFT, refuted, SHOWN, 56.0, RestSettings())


@pytest.mark.parametrize(("labels", "error", "refuted", "expected"), [
    (("coulomb_friction@p",), 0.01, False, "effects"),
    (("coulomb_friction@p",), 0.8, False, "unknown"),
    (("coulomb_friction@p",), 0.01, True, "unknown"),
    (("output_offset@y",), 0.01, False, "unknown"),
    (("output_gain@y", "output_offset@y"), 0.01, False, "unknown"),
    (("coulomb_friction@p", "output_offset@y"), 0.01, False, "effects"),
    (("coulomb_friction@p", "parameter_drift@k"), 0.01, False, "unknown"),
])  # fmt: skip
def test_where_more_than_noise_is_left_effects_are_named_that_cannot_follow_anything(
    labels, error, refuted, expected, monkeypatch
):
    assert _told(monkeypatch, labels, error, refuted)[0] == expected


@pytest.mark.parametrize(("gain", "by_chance", "expected"), [
    (231.0, 0.3, "unknown"), (231.0, 180.0, "effects"), (55.0, -3.0, "effects"), (57.0, -3.0, "unknown"),
])  # fmt: skip
def test_no_effect_is_named_beside_a_law_that_explains_more(monkeypatch, gain, by_chance, expected):
    law = Dependence(gain, by_chance, "what is left follows the position and the speed at `p`")
    verdict, rest = _told(monkeypatch, ("coulomb_friction@p",), 0.01, False, law)
    assert verdict == expected
    assert (rest.reasons == (law.statement,)) is (expected == "unknown")


def test_without_effects_nothing_can_do_harm():
    assert judged("parameters", (), held_out=(replace(GOOD, refitted=1.0, corrected=1.15),)).level is Level.GREEN
