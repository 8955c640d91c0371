"""A small search that several modules look at."""

import pytest

from tests.support.short_records import axis_likelihood
from tests.support.small_search import search_of


@pytest.fixture(scope="module")
def friction():
    likelihood, p = axis_likelihood(effects__coulomb_friction__motor__torque=0.8, J=1.04)
    done = []
    search = search_of(likelihood, noise_levels=7, first_level=3, shortlist=2, most_effects=2)
    search.progress = lambda *values: done.append(values)
    return search, p, *search.run(), done
