"""A search over a short record of an axis."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from orchestrator.diagnosis.fit.fitting import Parts
from orchestrator.diagnosis.search.search import Search
from orchestrator.records.model_file import Model, read_model
from tests.support.axis_record import MODEL
from tests.support.short_records import SETTINGS

PARTS = Parts(slice(10, 120), slice(120, 180), slice(180, 240))


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
