"""A slow joint under position control: the torque that its motion needs tells what free runs cannot."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis import passes as rules
from orchestrator.diagnosis.diagnose import DEFAULT_SETTINGS, diagnose
from orchestrator.diagnosis.fit.fitting import fit
from orchestrator.diagnosis.fit.sizes import Sized
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.torque_fit import torque_fit
from orchestrator.diagnosis.proof.reported import as_allowed
from orchestrator.diagnosis.proof.torque import TorqueProof
from orchestrator.diagnosis.search.search import Search
from orchestrator.records.model_file import Model, read_model
from tests.diagnosis.test_torque_fit import AXIS, FRICTION, joint_of
from tests.support.held_arm import held_arm_record


def model_of(folder: Path, inertia: float, viscous: float) -> Model:
    path = folder / "arm.toml"
    path.write_text(
        f'fmu = "ServoAxis"\n[parameters.J]\nvalue = {inertia}\nrelative_uncertainty = 0.6\n'
        f"[parameters.b]\nvalue = {viscous}\nrelative_uncertainty = 0.9\n[encoders.theta_m]\nnoise = 3e-5\n"
    )
    return read_model(path)


def test_gravity_and_friction_of_an_arm_that_is_held_up_are_named(tmp_path: Path) -> None:
    found = diagnose(held_arm_record(1.1, 1.8, 1.4, 10.5, 1.0, 0.15), model_of(tmp_path, 0.8, 1.0))
    sizes = {one.name: one.parameters for one in found.effects}
    assert set(sizes) == {"gravity_load", "coulomb_friction"}
    assert sizes["gravity_load"]["amplitude"].value == pytest.approx(10.5, rel=0.02)
    assert sizes["coulomb_friction"]["torque"].value == pytest.approx(1.4, rel=0.05)


@pytest.mark.parametrize(
    ("changed", "settles", "unknown", "chosen", "asked"),
    [("input_delay", 0.9, False, "given", 2), ("input_delay", 0.5, False, "first", 3),
     ("input_delay", 0.9, True, "first", 3), ("coulomb_friction", 0.9, False, "first", 2)],
)  # fmt: skip
def test_what_is_found_with_the_torque_as_given_counts_where_the_torque_settles_it(
    monkeypatch, changed, settles, unknown, chosen, asked
) -> None:
    likelihood, parts, _ = joint_of(1, 0.12)
    effect = next(one for one in AXIS.bank if one.name == changed)
    step = SimpleNamespace(accepted=True, candidates=[SimpleNamespace(effects=(effect,))])
    searches: list[bool] = []

    def found(name: str, is_unknown: bool) -> SimpleNamespace:
        return SimpleNamespace(
            name=name, unknown=is_unknown, hopeless=False, fell=frozenset(), likelihood=likelihood,
            left=SimpleNamespace(growth=1.0),
            proof=SimpleNamespace(torque=TorqueProof(settles, 0.95, sure=True)),
            search=SimpleNamespace(stopped=False, steps=[step]),
        )  # fmt: skip

    def judged(search: Search, *_: object) -> SimpleNamespace:
        searches.append(search.as_given)
        return found("given", unknown) if search.as_given else found("first", True)

    monkeypatch.setattr(rules, "judged", judged)
    monkeypatch.setattr(Search, "run", lambda search: (None, SimpleNamespace(effects=())))
    signals, nominal = likelihood.signals, likelihood.nominal
    got = rules.passes(SimpleNamespace(plant=AXIS), signals, parts, nominal, DEFAULT_SETTINGS, lambda *_: None)
    assert (got.name, len(searches), any(searches)) == (chosen, asked, changed == "input_delay")


@pytest.mark.parametrize(
    ("unknown", "suspects", "chosen"), [(False, ("b",), "barred"), (True, ("b",), "barred"), (True, (), "first")]
)
def test_what_came_second_is_looked_for_where_what_came_first_fell(monkeypatch, unknown, suspects, chosen) -> None:
    likelihood, parts, _ = joint_of(1, 0.12)
    asked: list[frozenset[str]] = []

    def found(name: str, is_unknown: bool, fell: frozenset[str], effects: tuple[str, ...]) -> SimpleNamespace:
        return SimpleNamespace(
            name=name, unknown=is_unknown, hopeless=True, fell=fell, best=SimpleNamespace(effects=effects),
            likelihood=likelihood, left=SimpleNamespace(growth=1.0), search=SimpleNamespace(stopped=False, steps=[]),
        )  # fmt: skip

    def judged(search: Search, *_: object) -> SimpleNamespace:
        asked.append(search.barred)
        if search.barred:
            return found("barred", unknown, frozenset(), suspects)
        return found("first", True, frozenset({"a"}), ())

    monkeypatch.setattr(rules, "judged", judged)
    monkeypatch.setattr(Search, "run", lambda search: (None, SimpleNamespace(effects=())))
    signals, nominal = likelihood.signals, likelihood.nominal
    got = rules.passes(SimpleNamespace(plant=AXIS), signals, parts, nominal, DEFAULT_SETTINGS, lambda *_: None)
    assert (got.name, asked) == (chosen, [frozenset(), frozenset({"a"})])


def test_the_model_file_tells_which_of_two_sizes_holds(tmp_path: Path) -> None:
    likelihood, parts, found = joint_of(1, 0.12)
    place = AXIS.index("J")
    p = found.p.copy()
    p[place] *= 3.0  # as a controller's answers make it
    told = Sized(replace(found, p=p))
    needed = torque_fit(likelihood, found, parts.fitted)
    chosen = as_allowed(likelihood, model_of(tmp_path, 1.0, 2.4), told, parts)
    assert np.allclose(chosen.fit.p[[place, AXIS.index(FRICTION)]], needed.p[[place, AXIS.index(FRICTION)]], rtol=1e-3)
    near = Sized(found)
    assert as_allowed(likelihood, model_of(tmp_path, 1.0, 2.4), near, parts) is near
    assert as_allowed(likelihood, model_of(tmp_path, 9.0, 2.4), told, parts) is told  # neither is allowed
    drag = "effects.quadratic_drag.coefficient"
    free = tuple(Free(AXIS.index(name), 0.1, 0.0, 1e3) for name in ("J", "b", drag))
    other = fit(likelihood, likelihood.nominal.copy(), 3.0, free, parts)
    poor = Sized(replace(other, p=np.where(np.arange(p.size) == place, 9.0, other.p)))
    assert as_allowed(likelihood, model_of(tmp_path, 1.0, 2.4), poor, parts) is poor  # its torque is not explained
