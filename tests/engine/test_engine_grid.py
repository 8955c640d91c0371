"""Designs: exact values, coverage, and that row i depends on i alone."""

import itertools
import json
import math
import random

import pytest
from scipy.stats import qmc

from orchestrator.engine import DesignCases, parse_design
from orchestrator.engine.grid import SOBOL_BLOCK, Bounds, Product, Randomised, Ranged, Sobol
from orchestrator.errors import ScenarioError


def rows(design):
    return [design.row(i) for i in range(len(design))]


def test_lists_and_ranges_make_a_full_grid_whose_last_name_varies_fastest():
    design = parse_design(["plant.alpha=0.1,0.2", "plant.k=range:1:3:3", "plant.backlash_model=dead_zone,nordin"], 5, 0)
    assert design.names == ("plant.alpha", "plant.k", "plant.backlash_model")
    assert rows(design) == [
        (alpha, k, model) for alpha in (0.1, 0.2) for k in (1.0, 2.0, 3.0) for model in ("dead_zone", "nordin")
    ]


def test_a_logarithmic_range_has_exact_ends_and_constant_ratios():
    values = [row[0] for row in rows(Ranged("a", 0.002, 0.1, 7, logarithmic=True))]
    assert (values[0], values[-1]) == (0.002, 0.1)
    ratios = [b / a for a, b in itertools.pairwise(values)]
    assert all(math.isclose(r, (0.1 / 0.002) ** (1 / 6), rel_tol=1e-12) for r in ratios)


@pytest.mark.parametrize("kind", [Randomised, Sobol])
def test_a_drawn_row_depends_on_its_index_and_seed_only(kind):
    bounds = (Bounds("a", -1.0, 2.0), Bounds("b", 1e-3, 1e3, logarithmic=True))
    count = 3 * SOBOL_BLOCK + 5
    indices = list(range(0, count, 97))
    straight = {i: kind(bounds, count, 3).row(i) for i in indices}
    random.Random(1).shuffle(indices)
    assert all(kind(bounds, count, 3).row(i) == straight[i] for i in indices)
    assert kind(bounds, count, 4).row(0) != straight[0]
    assert len(set(straight.values())) == len(indices)
    assert all(-1.0 <= a <= 2.0 and 1e-3 <= b <= 1e3 for a, b in straight.values())


def test_sobol_points_fill_the_square_better_than_random_ones():
    bounds = (Bounds("a", 0.0, 1.0), Bounds("b", 0.0, 1.0))
    sobol, drawn = (qmc.discrepancy(rows(kind(bounds, 512, 0))) for kind in (Sobol, Randomised))
    assert sobol < drawn / 10.0


def test_random_draws_are_uniform_over_all_parameters_together():
    design = parse_design(["a=random:0:1", "b=lograndom:1:100"], 4000, 11)
    assert len(design) == 4000
    a, b = zip(*rows(design), strict=True)
    assert abs(sum(a) / 4000 - 0.5) < 0.02
    assert abs(sum(x < 10.0 for x in b) / 4000 - 0.5) < 0.03


def test_a_million_cases_cost_nothing_until_they_are_asked_for():
    cases = DesignCases(parse_design(["a=range:0:1:1000", "b=range:0:1:1000", "c=1,2"], 1, 5), 5)
    assert len(cases) == 2_000_000
    case = cases[1_999_999]
    assert dict(case.parameters) == {"a": 1.0, "b": 1.0, "c": 2.0}
    with pytest.raises(IndexError):
        cases[2_000_000]


def test_cases_have_independent_reproducible_generators():
    cases = DesignCases(parse_design(["a=range:0:1:3"], 1, 5), 5)
    first = [cases[i].generator().standard_normal() for i in range(3)]
    assert first == [cases[i].generator().standard_normal() for i in range(3)]
    assert len(set(first)) == 3
    assert DesignCases(cases.design, 6)[0].generator().standard_normal() != first[0]


def test_draws_share_no_randomness_with_the_cases():
    cases = DesignCases(parse_design(["a=random:0:1"], 3, 5), 5)
    for i in range(3):
        assert cases[i].parameters["a"] != cases[i].generator().random()


def test_the_definition_is_plain_json_and_tells_designs_apart():
    texts = [["a=1,2"], ["a=1,3"], ["a=range:1:2:2"], ["a=random:1:2"], ["a=sobol:1:2"], ["a=lograndom:1:2"]]
    definitions = {json.dumps(DesignCases(parse_design(t, 2, 0), 0).definition(), sort_keys=True) for t in texts}
    assert len(definitions) == len(texts)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("plant.alpha", "NAME=SPECIFICATION"),
        ("=1", "NAME=SPECIFICATION"),
        (" = ", "NAME=SPECIFICATION"),
        ("a=1,nordin", "a list of numbers or one of words"),
        ("a=1,,2", "before and after each comma"),
        ("a=", "NAME=SPECIFICATION"),
        ("a=rnage:0:1:3", "of a kind among range"),
        ("a=range:0:1", "LOW:HIGH:COUNT"),
        ("a=range:0:1:2.5", "LOW:HIGH:COUNT"),
        ("a=random:0:x", "LOW:HIGH"),
        ("a=random:1:0", "lower bound below"),
        ("a=random:0:inf", "finite"),
        ("a=nan", "finite"),
        ("a=logrange:0:1:3", "positive"),
        ("a=lograndom:-1:1", "positive"),
        ("a=range:0:1:0", "the count of `a` must be 1 to 1,000,000,000, but is 0"),
        ("a=range:0:1:1e300", r"but is 1e\+300"),
    ],
)
def test_bad_specifications_are_named(text, said):
    with pytest.raises(ScenarioError, match=said):
        parse_design([text], 4, 0)


def test_the_number_of_cases_is_bounded():
    with pytest.raises(ScenarioError, match="at most 1,000,000,000 cases, but has 10,000,000,000"):
        parse_design(["a=range:0:1:100000", "b=range:0:1:100000"], 4, 0)
    with pytest.raises(ScenarioError, match="seed"):
        parse_design(["a=random:0:1"], 4, -1)


def test_a_parameter_is_varied_once():
    with pytest.raises(ScenarioError, match="varied 2 times"):
        parse_design(["a=1,2", "a=random:0:1"], 4, 0)
    with pytest.raises(ScenarioError, match="`vary` must name at least one parameter"):
        parse_design([], 4, 0)
    assert Product(()).names == ()
