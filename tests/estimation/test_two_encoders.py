"""The half-gap from two encoders without a torque, against the simulator of ``benchmarks.two_encoders``."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from benchmarks.two_encoders import Bench, make_bench
from orchestrator.cli import main
from orchestrator.estimation.methods import two_encoders
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns

FREE, HELD = 7_001, 7_002  # seeds of a bench whose load is pushed to and fro, and of one that is held


def _bench(seed: int, kind: str = "free") -> tuple[Bench, dict[str, np.ndarray]]:
    bench, columns = make_bench(seed, kind)
    return bench, columns


def _estimate(columns: dict[str, np.ndarray]):  # type: ignore[no-untyped-def]
    return two_encoders.estimate(record_from_columns(columns, "bench"), default_model())


@pytest.fixture(scope="module")
def free() -> tuple[Bench, dict[str, np.ndarray]]:
    return _bench(FREE)


@pytest.fixture(scope="module")
def held() -> tuple[Bench, dict[str, np.ndarray]]:
    return _bench(HELD, "held")


@pytest.mark.parametrize("seed", [FREE, *(pytest.param(n, marks=pytest.mark.night) for n in (7_010, 7_011, 7_012))])
def test_the_gap_the_ratio_and_the_late_channel_are_found(seed: int) -> None:
    bench, columns = _bench(seed)
    found = _estimate(columns)
    assert found.visible
    assert found.alpha == pytest.approx(bench.alpha, rel=0.1)
    assert found.interval[0] < bench.alpha < found.interval[1]
    assert found.diagnostics["load_late"]["value"] == pytest.approx(bench.late, abs=3e-4)
    assert found.diagnostics["parameters"]["i"]["value"] == pytest.approx(bench.ratio, rel=1e-3)


def test_the_interval_is_no_narrower_than_rounding_allows(free) -> None:
    bench, columns = free
    low, high = _estimate(columns).interval
    assert high - low > 0.02 * bench.count


def test_signs_missing_rows_and_a_torque_change_nothing(free) -> None:
    bench, columns = free
    plain = _estimate(columns)
    turned = _estimate(columns | {"theta_l": -columns["theta_l"]})
    assert turned.alpha == pytest.approx(plain.alpha, rel=0.01)
    holes = columns["theta_l"].copy()
    holes[np.random.default_rng(1).random(holes.size) < 0.05] = np.nan
    assert _estimate(columns | {"theta_l": holes}).alpha == pytest.approx(bench.alpha, rel=0.1)
    torque = np.sin(columns["time"])
    assert _estimate(columns | {"u": torque}).alpha == plain.alpha


def test_a_flank_loaded_throughout_hides_the_gap_and_the_advice_shows_it(held) -> None:
    found = _estimate(held[1])
    assert not found.visible
    assert math.isnan(found.alpha)
    assert found.interval == (0.0, math.inf)
    assert "let the load's torque change its direction several times" in found.message
    bench, freed = _bench(HELD)  # the same machine and moves, without the torque that held it
    assert _estimate(freed).alpha == pytest.approx(bench.alpha, rel=0.1)


def test_one_slip_is_no_gap(held) -> None:
    bench, columns = held
    slipped = columns["theta_l"] + np.where(columns["time"] > 5.0, 15.0 * bench.count, 0.0)
    found = _estimate(columns | {"theta_l": slipped})
    assert not found.visible
    assert "which a slip would do too" in found.message


def test_a_load_that_is_pushed_over_while_the_motor_is_still() -> None:
    """A torque from outside that changes its direction shows the gap in the load's angle alone."""
    rng, count, alpha = np.random.default_rng(4), 1e-3, 6e-3
    time = np.arange(8000) / 400.0
    side = np.sign(np.sin(2.0 * np.pi * time / 2.5))
    motor = 0.02 * np.sin(2.0 * np.pi * 0.13 * time)  # nearly still
    load = motor - alpha * side + 0.3 * count * rng.standard_normal(time.size)
    found = _estimate(
        {"time": time, "theta_m": 1e-4 * np.round(1e4 * motor), "theta_l": count * np.round(load / count)}
    )
    assert found.visible
    assert found.alpha == pytest.approx(alpha, rel=0.1)


def test_what_hardly_moves_is_not_estimated() -> None:
    time = np.arange(400) / 100.0
    still = {"time": time, "theta_m": np.where(time > 1.0, 1.0, 0.0), "theta_l": np.where(time > 1.0, 1.0, 0.0)}
    with pytest.raises(oc.NotApplicableError, match="must change in at least"):
        _estimate(still)


def _write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    table = np.column_stack([columns[name] for name in ("time", "theta_m", "theta_l")])
    np.savetxt(path, table, delimiter=",", header="time,pos_motor,pos_load", comments="", fmt="%.9g")
    return path


def test_the_commands_take_a_log_without_a_torque(free, tmp_path: Path, capsys) -> None:
    bench, columns = free
    log = _write(tmp_path / "bench.csv", columns)
    assert main(["inspect", str(log), "--out", str(tmp_path / "seen")]) == 0
    assert "The two angles alone show a half-gap" in " ".join(capsys.readouterr().out.split())
    model = tmp_path / "seen" / "model.toml"
    assert main(["estimate", str(log), "--model", str(model), "--out", str(tmp_path / "gap")]) == 0
    assert "cannot be told from a gap" in " ".join(capsys.readouterr().out.split())
    result = json.loads((tmp_path / "gap" / "estimate.json").read_text())["results"]
    assert result["method"] == "two_encoders"
    assert result["interval"][0] < bench.alpha < result["interval"][1]
    assert result["trust"]["level"] == "amber"
    assert "Which flank the teeth touch" in (tmp_path / "gap" / "report.html").read_text()


def test_no_number_stands_beside_a_gap_that_cannot_be_seen(held, tmp_path: Path, capsys) -> None:
    log = _write(tmp_path / "held.csv", held[1])
    assert main(["estimate", str(log), "--method", "all", "--out", str(tmp_path / "gap")]) == 0
    out = capsys.readouterr().out
    row = next(line for line in out.splitlines() if "two encoders" in line and "│" in line)
    assert [cell.strip() for cell in row.split("│")][1:4] == ["two encoders", "–", "no"]
    assert not any(character.isdigit() for character in row)
    assert "maximum_likelihood does not apply: needs the torque" in " ".join(out.split())
    result = json.loads((tmp_path / "gap" / "estimate.json").read_text())["results"]
    assert result.get("alpha") is None
    assert result.get("play") is None
    assert main(["inspect", str(log), "--out", str(tmp_path / "seen")]) == 0
    assert "the gap cannot be seen" in " ".join(capsys.readouterr().out.split())


def test_a_motor_alone_needs_a_torque(free, tmp_path: Path, capsys) -> None:
    log = _write(tmp_path / "bench.csv", free[1])
    assert main(["estimate", str(log), "--motor-only", "--out", str(tmp_path / "gap")]) == 2
    assert "`u` must be there" in capsys.readouterr().err


def test_several_logs_without_a_torque_are_refused_by_the_method(free) -> None:
    record: Record = record_from_columns(free[1], "bench")
    found = oc.estimate([record, record])
    assert not found.estimates
    assert "takes one record" in found.methods[0].reason
