"""A limit that an FMU states of a parameter stops a fit, is named, and no value beyond it is reported."""

import re
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.calibrate import CalibrationResult, calibrate
from tests.support.box_fmu import DOMAINS, write_fmu, write_map
from tests.support.box_records import record, write_record
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="no C compiler")
SPRING = DOMAINS[0]


def _limited(fmu: Path, name: str, limits: str) -> None:
    """Write limits, as attributes, into what an FMU says of a parameter."""
    whole = fmu.with_suffix(".whole")
    shutil.move(fmu, whole)
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(fmu, "w") as new:
        for entry in old.infolist():
            data = old.read(entry)
            if entry.filename == "modelDescription.xml":
                text, count = re.subn(rf'(name="{name}"[^>]*>\s*<Real )', rf"\1{limits} ", data.decode())
                assert count == 1
                data = text.encode()
            new.writestr(entry, data)


def _calibrated(folder: Path, limits: dict[str, str]) -> CalibrationResult:
    case = record(SPRING, (), np.random.default_rng(11), 700)
    log, fmu = write_record(folder / "record.csv", case), write_fmu(folder / "spring.fmu", SPRING, "")
    for name, text in limits.items():
        _limited(fmu, name, text)
    return calibrate(log, fmu, write_map(folder / "map.toml", SPRING, True))


@pytest.fixture(scope="module")
def free(tmp_path_factory: pytest.TempPathFactory) -> CalibrationResult:
    """The calibration without limits."""
    return _calibrated(tmp_path_factory.mktemp("free"), {})


def _between(free: CalibrationResult, name: str, share: float) -> float:
    """Return a value between the nominal one and the one that the record asks for."""
    found = free.calibration.diagnosis.parameters[name]
    return found.nominal + share * (found.value - found.nominal)


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("m", 0.5), ("k", 0.0), ("c", 0.5),
        *(pytest.param(*row, marks=pytest.mark.night) for row in (("m", 0.0), ("k", 0.5), ("c", 0.0))),
    ],
)  # fmt: skip
def test_a_limit_that_stops_the_fit_is_named(free, tmp_path: Path, name: str, share: float) -> None:
    """Also one that the nominal value stands at already."""
    end = _between(free, name, share)
    wanted = free.calibration.diagnosis.parameters[name]
    word = "max" if wanted.value > wanted.nominal else "min"
    found = _calibrated(tmp_path, {name: f'{word}="{end!r}"'}).calibration
    value = found.diagnosis.parameters[name]
    assert value.value == end
    assert (max if word == "max" else min)(value.interval) == end
    assert any(f"`{name}` is stopped by the FMU's `{word}`" in note for note in found.notes)
    assert not any(f"hardly determines `{name}`" in note for note in found.notes)


def test_a_limit_far_from_the_value_is_not_told_as_something_that_is_no_parameter(free, tmp_path: Path) -> None:
    wanted = free.calibration.diagnosis.parameters["m"]
    word = "max" if wanted.value > wanted.nominal else "min"
    found = _calibrated(tmp_path, {"m": f'{word}="{wanted.nominal!r}"'})
    assert not found.calibration.explained
    assert "within their limits" in found.trust.reasons[0]


def test_limits_that_stop_nothing_change_no_value_and_end_the_interval(free, tmp_path: Path) -> None:
    wanted = free.calibration.diagnosis.parameters["k"]
    place, word = (1, "max") if wanted.value > wanted.nominal else (0, "min")  # away from the nominal value
    near = 0.5 * (wanted.value + wanted.interval[place])
    found = _calibrated(tmp_path, {"k": f'{word}="{near!r}"'}).calibration
    k = found.diagnosis.parameters["k"]
    assert k.value == pytest.approx(wanted.value, abs=0.05 * wanted.standard_error)
    assert k.interval[place] == near
    assert not any("stopped" in note for note in found.notes)
    for name in ("m", "c"):
        other, before = found.diagnosis.parameters[name], free.calibration.diagnosis.parameters[name]
        assert other.interval == pytest.approx(before.interval, abs=0.1 * before.standard_error)


@pytest.mark.parametrize("nominal", [0.0, *(pytest.param(value, marks=pytest.mark.night) for value in (1e-3, -0.05))])
def test_a_value_near_zero_is_fitted_over_all_records_and_reported(nominal: float, tmp_path: Path) -> None:
    """Damping of 0.8 that the map begins with at zero, next to it, or with the wrong sign; two records share it."""
    cases = [record(SPRING, (), np.random.default_rng(11), rows) for rows in (600, 700)]
    assert cases[0].parameters == cases[1].parameters
    logs = [write_record(tmp_path / f"{n}.csv", case) for n, case in enumerate(cases)]
    fmu, path = write_fmu(tmp_path / "spring.fmu", SPRING, ""), write_map(tmp_path / "map.toml", SPRING, True)
    old = 'c = { uncertainty = "5 %" }'
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, f"c = {{ value = {nominal}, uncertainty = 1.0 }}"))
    fitted = calibrate(logs, fmu, path).results(tmp_path).parameters
    assert [*fitted] == ["m", "k", "c"]
    low, high = fitted["c"].interval
    assert low < cases[0].parameters[2] < high
    assert high - low < 0.05
    assert fitted["c"].nominal == nominal
    assert fitted["c"].learned > 0.9
