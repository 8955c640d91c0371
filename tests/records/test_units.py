"""Units in five formats: read right or refused, none taken as something else."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError, ScenarioError
from orchestrator.records.columns import Column, scale_of, unit_of
from orchestrator.records.formats import open_source
from orchestrator.records.formats.heads import head_of
from orchestrator.records.formats.source import Head
from orchestrator.records.model_file import read_model
from orchestrator.records.record import read_record
from orchestrator.records.units import angle_unit
from orchestrator.shared.units import is_unit
from tests.support.independent_plant import make_record
from tests.support.unit_spellings import KNOWN, REFUSED, truth

TRUTH = truth()
SPELLINGS = [text for entries in KNOWN.values() for texts, _ in entries for text in texts.split("|")] + REFUSED.split(
    "|"
)
TEXTS = list(dict.fromkeys(SPELLINGS))
WORTH = Column(counts_per_rev=4096.0, rated_value=50.0, torque_constant=2.0, resistance=1.0)
SCALES = {"counts": 2.0 * np.pi / 4096.0, "share": 0.5, "current": 2.0}


def test_there_are_two_hundred_spellings() -> None:
    assert len(TEXTS) >= 200


def _fault(text: str, column: str, kind: str, factor: float | None) -> str | None:
    """Return what is wrong with how a spelling is read; None where it is right, or refused by name without a factor."""
    try:
        unit = unit_of(column, Column(), text, "x", "log.csv")
    except RecordError as error:
        words = ("`x`", repr(text), f"[columns.{column}]")
        named = all(word in str(error) for word in words) and "\n" not in str(error)
        return None if factor is None and named else f"refused: {error}"
    if factor is None or unit is None or unit.kind != kind:
        return f"taken as {unit}"
    scale = scale_of(column, WORTH, unit, "x", "log.csv")
    return None if scale == pytest.approx(factor * SCALES.get(kind, 1.0), rel=1e-12) else f"scaled by {scale}"


def test_a_spelling_is_right_or_refused() -> None:
    assert not {row[:2]: fault for row in TRUTH if (fault := _fault(*row))}


def test_wrong_readings_of_a_spelling_are_found() -> None:
    wrong = (("deg", "theta_m", "angle", 1.0), ("deg", "theta_m", "", None), ("foo", "u", "torque", 1.0))
    assert all(map(_fault, *zip(*wrong, strict=True)))


def test_the_model_file_takes_the_same_spellings(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    for text, column, _, factor in TRUTH:
        path.write_text(f"[columns.{column}]\nunit = '{text}'\n", encoding="utf-8")
        if factor is None:
            with pytest.raises(ScenarioError, match=rf"columns\.{column}\.unit"):
                read_model(path)
        else:
            assert read_model(path).columns[column].unit == text


def _header(path: Path, form: str) -> None:
    lines = [";".join(form.format(n=n, text=text) for n, text in enumerate(TEXTS))]
    lines += [";".join(str(n + k) for k in range(len(TEXTS))) for n in range(3)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row_of_units(path: Path) -> None:
    lines = [";".join(f"x{n}" for n in range(len(TEXTS))), ";".join(TEXTS)]
    lines += [";".join(str(n + k) for k in range(len(TEXTS))) for n in range(3)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    time = np.arange(4.0)
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(time, time, name=f"x{n}", unit=text) for n, text in enumerate(TEXTS)])
        file.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


def _parquet(path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    fields = [
        pyarrow.field(f"x{n}", pyarrow.float64(), metadata={("unit", "Einheit")[n % 2]: text.encode()})
        for n, text in enumerate(TEXTS)
    ]
    arrays = [pyarrow.array(np.arange(4.0))] * len(TEXTS)
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), path)


def _hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for n, text in enumerate(TEXTS):
            key = ("unit", "Units", "Einheit", "physical_unit", "unit_string")[n % 5]  # the last by LabVIEW
            file.create_dataset(f"x{n}", data=np.arange(4.0)).attrs[key] = text if n % 3 else text.encode()


def _mat(path: Path) -> None:
    import scipy.io

    table = np.zeros(len(TEXTS), dtype=[("name", object), ("values", object), ("unit", object)])
    for n, text in enumerate(TEXTS):
        table[n] = (f"x{n}", np.arange(4.0), text)
    scipy.io.savemat(path.with_suffix(".mat"), {"log": table})
    path.with_suffix(".mat").rename(path)


FORMATS: dict[str, Callable[[Path], None]] = {
    "header, square brackets": lambda path: _header(path, "x{n} [{text}]"),
    "header, round brackets": lambda path: _header(path, "x{n} ({text})"),
    "header, behind a line": lambda path: _header(path, "x{n} / {text}"),
    "row of units": _row_of_units,
    "MDF": _mdf,
    "Parquet": _parquet,
    "HDF5": _hdf5,
    "MAT": _mat,
}
# What in round brackets or behind a line only says what a channel is; and numbers that stand for a channel.
DESCRIBING = frozenset(("1", "u", "x", "k", "q", "c"))


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_keeps_what_is_stated(form: str, tmp_path: Path) -> None:
    path = tmp_path / "log.dat"
    FORMATS[form](path)
    with open_source(path) as source:
        heads = {head.name: head for head in source.heads}
    for n, text in enumerate(TEXTS):
        head = heads.get(f"x{n}")
        if head is None and form.startswith("header,"):
            assert text in DESCRIBING, text
            continue
        assert head is not None, text
        assert head.unit == text


# A name, and the unit that its end states; empty: none.
NAMES = {
    "torque_Nmm": "Nmm", "TorqueNmm": "Nmm", "torque_nm": "nm", "u Nmm": "Nmm", "u[Nmm]": "Nmm", "u (Nmm)": "Nmm",
    "torque, ozf-in": "ozf-in", "torque_lb_in": "lb in", "trq_N_m": "N m", "torque/Nmm": "Nmm", "M / Nm": "Nm",
    "torque_Nmm_cmd": "Nmm", "pos_deg": "deg", "posDeg": "Deg", "pos_deg_raw": "deg", "pos_rotations": "rotations",
    "angle_0.1deg": "0.1deg", "angle 0.1 deg": "0.1 deg", "torque_0.1%": "0.1%", "speed_rad_s": "rad/s",
    "speed_deg_per_s": "deg per s", "speed [1/min]": "1/min", "n 1/min": "1/min", "time_ms": "ms", "t_s": "s",
    "u_pu": "pu", "enc_qc": "qc", "Winkel in Grad": "Grad", "u (gcm)": "gcm", "u [furlong]": "furlong", "u_%": "%",
    "theta_m": "", "theta_l": "", "u": "", "load (7)": "", "pos (8)": "", "angle (motor)": "", "Torque (filtered)": "",
    "q[0]": "", "axis[1].pos": "", "mass.s": "", "body.v": "", "theta_min": "", "pos_in": "", "MAIN.fPosM": "",
    "pos/motor": "", "T": "", "a.T": "",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_names_state_units(name: str) -> None:
    assert head_of(name).unit == NAMES[name]


def test_a_name_for_itself_keeps_its_unit() -> None:
    assert head_of("pos [deg]") == Head("pos", "deg", "number", 0, "pos [deg]")
    assert head_of("speed_x", "rpm").name == "speed_x"


@pytest.mark.parametrize(
    "text",
    ["Nm" * 30, "((((", "N**m", "N^m", "1/0 rev", "rad^99", "", " ", "N//m", "/", ".", "^2", "°°"],
)
def test_texts_that_are_no_unit(text: str) -> None:
    assert not is_unit(text)


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def _written(path: Path, columns: dict[str, np.ndarray], head: str, factor: float) -> None:
    rows = [f"{t:.6g},{factor * u:.12g},{m:.12g},{q:.12g}" for t, u, m, q in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def test_newton_millimetres_are_converted(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.csv"
    for head in ("time,torque_Nmm,theta_m,theta_l", "time,u [Nmm],theta_m,theta_l", "time,u (Nmm),theta_m,theta_l"):
        _written(path, columns, head, 1000.0)
        np.testing.assert_allclose(read_record(path).u, columns["u"], rtol=1e-9, atol=1e-9)


def test_what_is_not_known_is_refused_until_it_is_stated(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.csv"
    _written(path, columns, "time,u [gcm],theta_m,theta_l", 1e5 / 9.80665)
    with pytest.raises(RecordError, match=r"is in 'gcm': say `\[columns.u\] unit"):
        read_record(path)
    with pytest.raises(RecordError, match="is in 'gcm'"):  # a name alone does not state it
        read_record(path, {"u": Column("u")})
    record = read_record(path, {"u": Column(unit="N.m", factor=9.80665e-5)})
    np.testing.assert_allclose(record.u, columns["u"], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("units", "unit"),
    [(("deg", "rad"), "deg"), (("", "rev"), "turns"), (("counts", "Grad"), "deg"), (("mm", ""), "rad"),
     (("arcmin",), "arcmin"), (("mrad", "deg"), "rad"), ((), "rad")],
)  # fmt: skip
def test_angles_are_shown_in_the_unit_of_the_log(units: tuple[str, ...], unit: str) -> None:
    assert angle_unit(units) == unit


def test_a_record_knows_the_unit_of_its_angles(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    names = {"time": "time [s]", "u": "u [N.m]", "theta_m": "theta_m [rev]", "theta_l": "theta_l [deg]"}
    scaled = columns | {"theta_m": columns["theta_m"] / (2 * np.pi), "theta_l": np.degrees(columns["theta_l"])}
    path = tmp_path / "log.csv"
    rows = zip(*(scaled[name].tolist() for name in names), strict=True)
    path.write_text("\n".join([",".join(names.values()), *(",".join(map(repr, row)) for row in rows)]))
    assert read_record(path).angle_unit == "deg"
