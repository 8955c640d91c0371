"""A search over a short record of an axis."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.search.search import Search
from orchestrator.plants.effects import Effect
from orchestrator.records.model_file import Model, read_model
from tests.support.axis_record import MODEL
from tests.support.short_records import AXIS, SETTINGS

PARTS = Parts(slice(10, 120), slice(120, 180), slice(180, 240))
SEARCH = SETTINGS.search
BANK = {effect.label: effect for effect in AXIS.bank}
PLAIN = BANK["load_torque@load"]  # one parameter, leaves 1 %
FRICTION = BANK["coulomb_friction@motor"]  # leaves 4 %
STRIBECK = BANK["stribeck_friction@motor"]  # three parameters


def axis_model() -> Model:
    """Return the nominal model of the axis."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "m.toml"
        path.write_text(MODEL)
        return read_model(path)


def search_of(likelihood, **settings) -> Search:
    """Return a search over a record, with other ``settings`` of the search."""
    quick = msgspec.structs.replace(SETTINGS, search=msgspec.structs.replace(SETTINGS.search, **settings))
    return Search(replace(likelihood, settings=quick), axis_model(), PARTS, most=quick.search.most_effects)


def candidate(fitted: float, validated: float, *effects: Effect, q: float = 1e-5, settings=SEARCH) -> Candidate:
    found = Fit(np.zeros(1), q, np.zeros((1, 1)), (), np.zeros((0, 0)), fitted, validated)
    return Candidate(effects, found, settings)


def labels(effects) -> set[str]:
    return {effect.label for effect in effects}


BASE = candidate(0.0, 0.0)
