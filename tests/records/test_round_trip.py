"""What a log and a model file say comes back: any legal way of writing the same thing is read as the same thing."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.plants.known import plants
from orchestrator.records.model_file import read_model
from orchestrator.records.model_text import model_text, toml_text
from orchestrator.records.record import read_record

QUICK = settings(max_examples=200, database=None)
ANGLES = {
    "rad": 1.0, "deg": math.pi / 180.0, "0.1 deg": math.pi / 1800.0, "rev": 2.0 * math.pi, "gon": math.pi / 200.0,
    "arcmin": math.pi / 10800.0, "mrad": 1e-3, "counts": None,
}  # fmt: skip
TORQUES = {
    "N.m": 1.0, "mN.m": 1e-3, "N.mm": 1e-3, "N.cm": 1e-2, "kN.m": 1e3, "lbf.in": 4.4482216152605 * 0.0254, "%": None,
    "0.1 %": None, "p.u.": None, "A": None, "mA": None,
}  # fmt: skip
SHARES = {"%": 0.01, "0.1 %": 0.001, "p.u.": 1.0}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0}
NAMES = {"time": "Zeit", "u": "Soll", "theta_m": "Lage 1", "theta_l": "Lage 2"}
COLUMNS = tuple(NAMES)
number = st.floats(0.25, 4.0)


@st.composite
def columns(draw):
    """How each column is written: unit, stated numbers, and the SI value of one of its units."""
    found = {}
    for name in COLUMNS:
        units = {"time": TIMES, "u": TORQUES}.get(name, ANGLES)
        unit = draw(st.sampled_from(sorted(units)))
        stated, worth = {"unit": unit}, units[unit]
        if unit == "counts":
            stated["counts_per_rev"] = draw(st.sampled_from([1000, 8192, 65536, 20_000]))
            worth = 2.0 * math.pi / stated["counts_per_rev"]
        elif unit in SHARES:
            stated["rated_value"] = draw(number)
            worth = SHARES[unit] * stated["rated_value"]
        elif unit in ("A", "mA"):
            stated["torque_constant"] = draw(number)
            worth = stated["torque_constant"] * {"A": 1.0, "mA": 1e-3}[unit]
        if name != "time" and unit != "counts" and draw(st.booleans()):
            stated["factor"] = draw(number) * draw(st.sampled_from([-1.0, 1.0]))
            stated["offset"] = draw(st.floats(-3.0, 3.0))
        ways = ["modulo", "sign_bit", "", ""] if unit == "counts" or name == "u" else [""]
        if way := draw(st.sampled_from(ways)):
            stated[way] = {"modulo": 65536.0, "sign_bit": 2.0**23}[way]  # the motion is at most 4e5 counts
            if name != "u" and way == "modulo":
                stated["modulo"] = float(stated["counts_per_rev"])
                stated.pop("factor", None)
            if name == "u":  # whole numbers of a drive, a thousandth of the motion's torque each
                stated["factor"] = 3e-3 / worth
                stated.pop("offset", None)
        found[name] = stated, worth
    if draw(st.integers(0, 3)) == 0:
        found["time"] = {"rate": draw(st.sampled_from([100.0, 250.0, 1000.0, 4000.0]))}, None
    return found


@st.composite
def dialects(draw):
    """How the cells are written."""
    separator = draw(st.sampled_from([",", ";", "\t", "|"]))
    decimal = draw(st.sampled_from([".", ","] if separator != "," else ["."]))
    return {
        "separator": separator, "decimal": decimal, "end": draw(st.sampled_from(["\n", "\r\n"])),
        "order": draw(st.permutations(COLUMNS)), "quoted": draw(st.booleans()), "by_place": draw(st.booleans()),
        "preamble": draw(
            st.sampled_from([[], ["Device: drive 7"], ["Device;drive 7", "Date;2026-03-04", ""]])),
        "units": draw(st.sampled_from(["model", "name", "row"])),
        "encoding": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])),
        "digits": draw(st.sampled_from(["{:.12g}", "{:.12e}", "{!r}"])),
    }  # fmt: skip


def made_motion(seed, step):
    """Time, request and angles of a smooth motion that crosses several turns of the motor."""
    rng = np.random.default_rng(seed)
    time = step * np.arange(220)
    phases, sizes = rng.uniform(0.0, 6.0, 3), rng.uniform(0.2, 1.0, 3)
    turns = [2.0 * np.pi * (n + 1) * time / time[-1] + phase for n, phase in enumerate(phases)]
    load = sum(size * np.sin(turn) for size, turn in zip(sizes, turns, strict=True))
    speed = np.gradient(load, step)
    motor = 4.0 * load + 0.05 * np.tanh(speed / np.abs(speed).max() * 20.0)
    return {
        "time": time,
        "u": 3.0 * np.cos(turns[0]) + rng.normal(0.0, 0.1, time.size),
        "theta_m": motor,
        "theta_l": load,
    }


def written_log(folder, truth, said, dialect):
    """Write log and model file, and return what each column comes back as."""
    cells, expected, tables = {}, dict(truth), []
    for name, (stated, worth) in said.items():
        values = truth[name] / worth if worth else np.arange(truth[name].size, dtype=float) + 7.0
        values = (values - stated.get("offset", 0.0)) / stated.get("factor", 1.0)
        whole = stated.get("unit") == "counts" or worth is None or "modulo" in stated or "sign_bit" in stated
        if whole and worth:
            values = np.round(values)
            expected[name] = (values * stated.get("factor", 1.0) + stated.get("offset", 0.0)) * worth
        if "modulo" in stated:
            values = np.mod(values, stated["modulo"])
        elif "sign_bit" in stated:
            values = np.where(values < 0.0, stated["sign_bit"] - values, values)
        shape = "{:.0f}" if whole else dialect["digits"]
        cells[name] = [shape.format(float(v)).replace(".", dialect["decimal"]) for v in values]
        where = dialect["order"].index(name) + 1
        place = f"#{where}" if dialect["by_place"] else NAMES[name]
        kept = {k: v for k, v in stated.items() if k != "unit" or dialect["units"] == "model"}
        if dialect["units"] == "name" and "unit" in stated and not dialect["by_place"]:
            place = f"{NAMES[name]} [{stated['unit']}]"
        tables += [f"[columns.{name}]", f"name = {toml_text(place)}"]
        tables += [f"{key} = {toml_text(v) if isinstance(v, str) else repr(v)}" for key, v in kept.items()]
    head = {
        name: NAMES[name]
        + (f" [{said[name][0]['unit']}]" if dialect["units"] == "name" and "unit" in said[name][0] else "")
        for name in COLUMNS
    }
    lines = [[head[name] for name in dialect["order"]]]
    if dialect["units"] == "row":
        lines.append([said[name][0].get("unit", "-") for name in dialect["order"]])
    lines += list(zip(*(cells[name] for name in dialect["order"]), strict=True))
    quote = '"' if dialect["quoted"] else ""
    text = "".join(f"{line}{dialect['end']}" for line in dialect["preamble"]) + "".join(
        dialect["separator"].join(f"{quote}{cell}{quote}" for cell in line) + dialect["end"] for line in lines
    )
    (folder / "log.csv").write_bytes(text.encode(dialect["encoding"]))
    (folder / "model.toml").write_text("\n".join(tables) + "\n", encoding="utf-8")
    return expected


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("round")


@QUICK
@given(said=columns(), dialect=dialects(), seed=st.integers(0, 10_000))
def test_a_log_comes_back_from_any_units_numbers_and_dialect(folder, said, dialect, seed):
    rate = said["time"][0].get("rate", 250.0)
    truth = made_motion(seed, 1.0 / rate)
    expected = written_log(folder, truth, said, dialect)
    model = read_model(folder / "model.toml")
    record = read_record(folder / "log.csv", model.columns)
    assert np.diff(record.time) == pytest.approx(1.0 / rate, rel=1e-6)
    assert record.size == truth["time"].size
    for name in ("u", "theta_m", "theta_l"):
        got = getattr(record, name)
        wanted = expected[name]
        if name != "u" and "modulo" in said[name][0]:  # whole turns are what a counter that starts again cannot tell
            got, wanted = got - got[0], wanted - wanted[0]
        np.testing.assert_allclose(got, wanted, rtol=1e-8, atol=1e-7 * np.ptp(wanted))


@st.composite
def models(draw):
    """A plant, and what a model file says of parameters, encoders and columns."""
    plant = plants()[draw(st.sampled_from(sorted(plants())))]
    rows = draw(st.lists(st.sampled_from(plant.table), unique_by=lambda row: row.name, max_size=6))
    parameters = {}
    for row in rows:
        low, high = max(row.minimum, -1e6), min(row.maximum, 1e6)
        value = draw(st.floats(low, high, allow_subnormal=False).filter(lambda x: x != 0.0))
        entry = {"value": value}
        if draw(st.booleans()):
            entry |= draw(
                st.one_of(
                    st.builds(lambda v: {"uncertainty": v}, st.floats(0.0, 1e3)),
                    st.builds(lambda v: {"relative_uncertainty": v}, st.floats(0.0, 0.99)),
                )
            )
        parameters[row.name] = entry
    encoders = {}
    for name in draw(st.lists(st.sampled_from(["theta_m", "theta_l"]), unique=True)):
        ways = [{}, {"resolution": draw(st.floats(0.0, 0.1))}, {"counts_per_rev": draw(st.integers(1, 10**7))}]
        encoders[name] = draw(st.sampled_from(ways)) | draw(st.sampled_from([{}, {"noise": draw(st.floats(0.0, 0.1))}]))
    text = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=8)
    said = {name: stated | {"name": draw(text)} for name, (stated, _) in draw(columns()).items()}
    return plant, parameters, encoders, said


def written_table(path, entry, inline):
    """One entry in either notation of TOML, whole numbers as such at times."""
    pairs = [f"{key} = {toml_text(v) if isinstance(v, str) else repr(v)}" for key, v in entry.items()]
    if inline:
        group, name = path.split(".", 1)
        return f"[{group}.{name}]\n" + "".join(f"{pair}  # said\n" for pair in pairs)
    return f"{path} = {{ {', '.join(pairs)} }}\n"


@QUICK
@given(said=models(), inline=st.booleans())
def test_a_model_file_comes_back_by_hand_and_as_it_is_written(folder, said, inline):
    plant, parameters, encoders, named = said
    groups = {"parameters": parameters, "encoders": encoders, "columns": named}
    entries = [(f'{group}."{name}"', entry) for group, table in groups.items() for name, entry in table.items()]
    path = folder / "model.toml"
    head = f"fmu = {toml_text(plant.name)}\n"
    path.write_text(head + "".join(written_table(*entry, inline) for entry in entries), encoding="utf-8")
    model = read_model(path)
    doubts = any(len(entry) > 1 for entry in parameters.values())
    for row in plant.table:
        entry, got = parameters.get(row.name, {}), model.parameters[row.name]
        assert got.value == entry.get("value", row.default)
        spread = 0.0 if doubts else plant.spread * (row.name in plant.linear)
        if "relative_uncertainty" in entry or "uncertainty" not in entry:
            wanted = entry.get("relative_uncertainty", spread) * abs(got.value)
        else:
            wanted = entry["uncertainty"]
        assert got.uncertainty == pytest.approx(wanted, rel=1e-12)
        assert got.unit == row.unit
    for name, entry in encoders.items():
        turn = 2.0 * math.pi
        resolution = turn / entry["counts_per_rev"] if "counts_per_rev" in entry else entry.get("resolution")
        assert (model.encoder(name).resolution, model.encoder(name).noise) == (resolution, entry.get("noise"))
    for name, entry in named.items():
        assert {key: getattr(model.columns[name], key) for key in entry} == entry
    values = {name: (p.value, p.uncertainty) for name, p in model.parameters.items()}
    path.write_text(model_text(model, values, None), encoding="utf-8")
    again = read_model(path)
    assert (again.parameters, again.columns) == (model.parameters, model.columns)
    assert all(again.encoder(name) == model.encoder(name) for name in ("theta_m", "theta_l"))
