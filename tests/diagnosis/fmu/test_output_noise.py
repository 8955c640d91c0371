"""The noise of an output: as a map says it, unless the record shows somewhat more."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.fmu.probing import output_noise, third_differences

TRUE = 2e-3
N = 1500


def record(count: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A slow motion and the same as an encoder shows it, in whole counts where it has such."""
    y = np.sin(np.linspace(0.0, 40.0, N))[:, None]
    seen = y + TRUE * np.random.default_rng(6).standard_normal((N, 1))
    return y, seen if count == 0.0 else count * np.rint(seen / count)


def noise(given: float | None, seen: np.ndarray, *traces: np.ndarray, factor: float = 1.0):
    entry = SimpleNamespace(noise=given, factor=factor)
    values, notes = output_noise(
        SimpleNamespace(outputs={"y": entry}), SimpleNamespace(outputs=seen, factor=1), [seen, *traces]
    )
    return float(values[0]), notes


@pytest.mark.parametrize("count", [0.0, 4e-3])
def test_the_noise_is_that_of_third_differences_counts_included(count):
    _, seen = record(count)
    assert third_differences(seen)[0] == pytest.approx(np.hypot(TRUE, count / np.sqrt(12.0)), rel=0.1)


@pytest.mark.parametrize(
    ("given", "expected", "told"),
    [
        (None, TRUE, ""),
        (TRUE, TRUE, ""),
        (1.5 * TRUE, 1.5 * TRUE, ""),
        (4.0 * TRUE, 4.0 * TRUE, "intervals are as wide"),  # noise that was filtered hardly shows in differences
        (0.7 * TRUE, TRUE, "that is used"),
        (0.2 * TRUE, TRUE, "that is used"),
        (0.02 * TRUE, 0.02 * TRUE, "the FMU lacks"),
    ],
)
def test_a_map_that_says_too_little_is_put_right_and_one_that_is_far_off_is_believed(given, expected, told):
    _, seen = record()
    found, notes = noise(given, seen)
    assert found == pytest.approx(expected, rel=0.1)
    assert len(notes) == bool(told)
    assert all(told in note and "`y`" in note for note in notes)


def test_what_a_model_leaves_counts_where_it_is_smoother_than_what_was_measured():
    y, seen = record()
    quick = np.sin(np.linspace(0.0, 900.0, N))[:, None]
    assert noise(0.7 * TRUE, seen + quick, seen - y)[0] == pytest.approx(TRUE, rel=0.1)


def test_a_note_speaks_in_the_unit_of_the_column():
    _, seen = record()
    found, (note,) = noise(0.7 * TRUE / 10.0, seen, factor=-10.0)
    assert found == pytest.approx(TRUE, rel=0.1)
    assert "a noise of 0.00014, the record shows 0.00019" in note
