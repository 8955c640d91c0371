"""What a record does not tell apart, for each effect. Fits are made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.settings import DEFAULT
from orchestrator.diagnosis.blackbox.steps import SearchStep
from orchestrator.diagnosis.blackbox.verdict import settled_names

SCENE = Surroundings(0.01, 1.0, 1.0, np.linspace(-1.0, 1.0, 400))
NONE = np.zeros((1, 1))


def at(name: str) -> BoxEffect:
    return BoxEffect(BANK[name], "p", SCENE)


def fit(total: float, *names: str) -> BoxFit:
    model = BoxModel(np.zeros(0))
    for name in names:
        model = model.extended(at(name), np.full(len(BANK[name].parameters), 0.1))
    return BoxFit(model, 0, NONE, total, 0.0, 0.0, NONE)


def search(totals: dict[str, float], *steps: SearchStep, share: float = 0.0) -> SimpleNamespace:
    """Return a search whose fits of further models have the totals given, by all effects or by their last one.

    ``share``: noise at the ports beside all of them.
    """

    def fitted(model: BoxModel, level: int, iterations: int | None = None) -> BoxFit:
        names = [e.kind.name for e in model.effects]
        return fit(totals.get("+".join(names), totals[names[-1]]), *names)

    fitter = SimpleNamespace(
        fit=fitted,
        settled=lambda found: found,
        ladder=SimpleNamespace(share=lambda level: share),
        problem=SimpleNamespace(),
    )
    return SimpleNamespace(
        recalled=lambda found: found,
        fitter=fitter, steps=steps, earlier=(), settings=DEFAULT.search, score=lambda found: found.total,
        richer=lambda fit, k: [], effects=(),
    )  # fmt: skip


def test_an_earlier_effect_has_a_family_too() -> None:
    first = SearchStep(fit(-90.0), (fit(-50.0, "input_delay"), fit(-52.0, "input_lag"), fit(-80.0, "load")), True)
    best = fit(-10.0, "input_delay", "spring")
    alone = fit(-50.0, "input_delay")
    second = SearchStep(alone, (best, fit(-40.0, "input_delay", "load")), True)
    found, families = settled_names(search({"input_lag": -12.0, "load": -70.0}, first, second), best)
    assert found is best
    assert families == (("input_lag@p",), ())


@pytest.mark.parametrize(("lag", "told"), [(-52.0, False), (-70.0, True)])
def test_what_did_as_well_in_its_step_is_fitted_anew_beside_an_effect_that_has_been_fitted_further(lag, told) -> None:
    step = SearchStep(fit(-90.0), (fit(-50.0, "input_delay"), fit(lag, "input_lag")), True)
    families = settled_names(search({"input_lag": -12.0}, step), fit(-10.0, "input_delay"))[1]
    assert families == (() if told else ("input_lag@p",),)


def test_what_contains_an_effect_is_none_of_its_family() -> None:
    best = fit(-10.0, "coulomb_friction")
    step = SearchStep(fit(-90.0), (best, fit(-9.0, "stribeck_friction"), fit(-13.0, "viscous_drag")), True)
    assert settled_names(search({}, step), best)[1] == (("viscous_drag@p",),)


@pytest.mark.parametrize(("total", "sliding", "speed", "told"), [
    (-12.0, 0.06, 1.0, False),  # as likely, and falls by a quarter within the motion
    (-17.0, 0.06, 1.0, True),  # less likely
    (-12.0, 0.095, 1.0, True),  # hardly another law
    (-12.0, 0.06, 9.0, True),  # falls beyond the speeds of the record
])  # fmt: skip
def test_what_contains_an_effect_is_of_its_family_where_its_law_is_another(total, sliding, speed, told) -> None:
    best = fit(-10.0, "coulomb_friction")
    values = np.array([sliding, 0.1, speed, 0.01])
    model = BoxModel(np.zeros(0)).extended(at("stribeck_friction"), values)
    found = search({})
    found.richer = lambda fit, k: [BoxFit(model, 0, NONE, total, 0.0, 0.0, NONE)]
    assert settled_names(found, best)[1] == ((() if told else ("stribeck_friction@p",)),)


@pytest.mark.parametrize(("values", "total", "name"), [
    ((0.036, 0.023, 1e-300, 1e-300), -14.0, "coulomb_friction"),  # no other law, and as likely
    ((0.036, 0.037, 1.0, 0.001), -14.0, "coulomb_friction"),
    ((0.036, 0.023, 1e-300, 1e-300), -17.0, "stribeck_friction"),  # its start or its end makes a difference
    ((0.036, 0.060, 1.0, 0.001), -9.0, "stribeck_friction"),
])  # fmt: skip
def test_a_law_that_has_become_the_one_that_it_contains_goes_by_its_name(values, total, name) -> None:
    model = BoxModel(np.zeros(0)).extended(at("stribeck_friction"), np.array(values))
    best = BoxFit(model, 0, NONE, -10.0, 0.0, 0.0, NONE)
    found, _ = settled_names(search({"coulomb_friction": total}), best)
    assert [effect.kind.name for effect in found.model.effects] == [name]


def test_what_stood_beside_an_effect_in_an_earlier_search_is_fitted_anew() -> None:
    best = fit(-10.0, "input_delay")
    step = SearchStep(fit(-900.0), (fit(-800.0, "input_delay"), fit(-11.0, "input_lag"), fit(-801.0, "load")), True)
    found = search({"input_lag": -70.0, "load": -12.0})
    found.earlier = (step,)
    assert settled_names(found, best)[1] == (("load@p",),)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("name", "twin"), [("input_offset", "load"), ("load", "input_offset")])
def test_a_load_is_an_offset_of_its_ports_input_though_no_step_fitted_both(name: str, twin: str, sign: float) -> None:
    places = {"input_offset": "u", "load": "p", "input_lag": "u"}
    own, other, lag = (BoxEffect(BANK[kind], places[kind], SCENE) for kind in (name, twin, "input_lag"))
    found, started = search({}), []
    found.effects = (lag, own, other)
    ports = {"p": SimpleNamespace(input="u")}
    found.fitter.problem = SimpleNamespace(map=SimpleNamespace(ports=ports), sign={"p": sign})

    def fitted(model: BoxModel, level: int) -> BoxFit:
        started.append(model)
        return BoxFit(model, 0, NONE, -10.0, 0.0, 0.0, NONE)

    found.fitter.fit = fitted
    best = BoxModel(np.zeros(0)).extended(lag, np.array([0.1])).extended(own, np.array([3.0]))
    assert settled_names(found, BoxFit(best, 0, NONE, -10.0, 0.0, 0.0, NONE))[1] == ((), (other.label,))
    assert [model.values[-1][0] for model in started] == [-sign * 3.0]
    places["input_offset"] = "another"
    found.effects = tuple(BoxEffect(BANK[kind], places[kind], SCENE) for kind in (name, twin))
    elsewhere = BoxModel(np.zeros(0)).extended(found.effects[0], np.array([3.0]))
    assert settled_names(found, BoxFit(elsewhere, 0, NONE, -10.0, 0.0, 0.0, NONE))[1] == ((),)


def test_what_does_better_in_the_place_of_an_effect_stays_there() -> None:
    first = SearchStep(fit(-90.0), (fit(-50.0, "input_lag"), fit(-52.0, "input_delay"), fit(-80.0, "load")), True)
    found, families = settled_names(
        search({"spring+input_delay": -5.0, "input_delay": -52.0, "input_lag": -30.0, "load": -70.0}, first),
        fit(-30.0, "input_lag", "spring"),
    )
    assert [effect.kind.name for effect in found.model.effects] == ["spring", "input_delay"]
    assert families == ((), ())


def test_one_effect_that_does_better_than_two_is_named_alone() -> None:
    first = SearchStep(fit(-90.0), (fit(-50.0, "hardening_spring"), fit(-52.0, "spring"), fit(-80.0, "load")), True)
    found, families = settled_names(
        search({"spring": -9.0, "hardening_spring": -50.0, "load": -70.0}, first),
        fit(-10.0, "hardening_spring", "input_offset"),
    )
    assert [effect.kind.name for effect in found.model.effects] == ["spring"]
    assert families == ((),)


def test_beside_noise_a_rival_starts_from_what_it_promises_too(monkeypatch) -> None:
    best = fit(-10.0, "input_offset")
    step = SearchStep(fit(-900.0), (fit(-800.0, "input_offset"), fit(-700.0, "coulomb_friction")), True)
    promise = SimpleNamespace(effect=at("coulomb_friction"), values=np.array([0.04, 0.01]))
    monkeypatch.setattr("orchestrator.diagnosis.blackbox.verdict._promised", lambda *given: [promise])

    def told(share: float, unit: str = "N.m") -> tuple[tuple[str, ...], ...]:
        found = search({}, share=share)
        found.earlier = (step,)

        def fitted(model: BoxModel, level: int) -> BoxFit:
            led = model.values[-1][0] == 0.04  # from where its own fit ended it comes nowhere
            return BoxFit(model, 0, NONE, -11.0 if led else -300.0, 0.0, 0.0, NONE)

        found.fitter.fit = fitted
        ports = {"p": SimpleNamespace(input="u")}
        found.fitter.problem = SimpleNamespace(units={"u": unit}, map=SimpleNamespace(ports=ports))
        return settled_names(found, best)[1]

    assert told(0.0) == ((),)
    assert told(0.02, unit="W") == (("coulomb_friction@p",),)  # heat has no friction
    assert told(0.02) == (("input_offset@p",),)  # every machine has: it stands for the offset
