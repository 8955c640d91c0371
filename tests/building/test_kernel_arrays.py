"""Arrays in the translated subset: the bits of plain Python, refusals with their line, checks of arguments."""

import importlib
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from orchestrator.building.translation.kernel_arrays import plain_array, scratch
from orchestrator.building.translation.kernels import Kernels
from orchestrator.building.translation.library import HEADERS, library_text
from orchestrator.errors import FmuError
from orchestrator.shared.machine_code import FLAGS, local_compiler

HEAD = """
import math
from typing import Annotated, Any
from orchestrator.building.translation.kernel_arrays import Pairs, Reals, Table, Wholes, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind
Square = Annotated[Any, ArrayKind(REAL, (3, 3))]
Cube = Annotated[Any, ArrayKind(REAL, (None, 3, 3))]
__all__ = ["f"]
"""


def kernels(folder: Path, body: str, monkeypatch: pytest.MonkeyPatch, name: str, checked: bool = True) -> Kernels:
    (folder / f"{name}.py").write_text(HEAD + body)
    monkeypatch.syspath_prepend(str(folder))
    importlib.invalidate_caches()
    return Kernels(name, checked)


def both(found: Kernels, *arguments: Any) -> list[float]:
    """What plain Python and C leave in the arrays, which must be the same bits."""
    in_c = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
    plain = [plain_array(a) if isinstance(a, np.ndarray) else a for a in arguments]
    results = [found.f(*in_c), found.python.f(*plain)]
    assert results[0] == results[1]
    numbers = [n for a in in_c if isinstance(a, np.ndarray) for n in a.ravel().tolist()]
    assert list(map(repr, numbers)) == [repr(n) for a in plain if hasattr(a, "tolist") for n in a.tolist()]
    return numbers


MIXED = """
def fill(row: Reals, start: float) -> None:
    for n in range(len(row)):
        row[n] = start + n

def trace(a: Square) -> float:
    total = 0.0
    for n in range(3):
        total += a[n, n]
    return total

def f(x: Reals, table: Table, cube: Cube, counts: Wholes, out: Pairs, really: bool) -> float:
    work = scratch(3, 3)
    fill(work[1], 0.5)
    for k in range(len(cube)):
        part = cube[k]
        for r in range(3):
            row = part[r]
            row[-1] += work[1, r] * x[k % len(x)]
    for n in range(out.shape[0]):
        out[n, 0], out[n, 1] = x[n], table[n, -1] if really else table[n, 0]
        counts[n] += n * table.shape[1]
    return trace(cube[len(cube) - 1]) + trace(work)
"""


def test_items_parts_lengths_and_scratch_are_those_of_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = kernels(tmp_path, MIXED, monkeypatch, "mixed_arrays")
    rng = np.random.default_rng(2)
    for really in (False, True):
        both(found, rng.normal(size=4), rng.normal(size=(4, 5)), rng.normal(size=(3, 3, 3)),
             np.arange(4), np.zeros((4, 2)), really)  # fmt: skip


REFUSED = {
    "def f(x: Reals) -> Reals:\n    return x\n": "must not return an array",
    "def f(x: Reals) -> float:\n    return x[0, 1]\n": "as many indices at most",
    "def f(x: Table) -> float:\n    return x[0:1, 1]\n": "no slices",
    "def f(x: Reals) -> None:\n    y = x\n    y = x\n    y[0] = 1.0\n": "must be assigned once",
    "def f(x: Table) -> None:\n    x[0] = x[1]\n": "cannot be assigned to",
    "def f(x: Reals) -> None:\n    y = scratch(len(x))\n    y[0] = x[0]\n": "must be constants",
    "def f(x: Reals) -> None:\n    if x[0] > 0.0:\n        y = scratch(3)\n    y[0] = x[0]\n": "can see it",
    "def g(x: Square) -> float:\n    return x[0, 0]\ndef f(x: Table) -> float:\n    return g(x)\n": "array of float",
    "def f(x: Reals) -> float:\n    return x + 1.0\n": "must be of numbers",
    "def f(x: tuple[float, float]) -> float:\n    return x[0]\n": "must be a number or an array",
    "def f(x: Reals) -> float:\n    return sum(x)\n": "outside the subset",
    "def f(x: Reals) -> float:\n    return x.mean()\n": "must be a function of the sources",
}  # fmt: skip


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_is_outside_is_refused_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    body, words = list(REFUSED.items())[number]
    name = f"refused_array_{number}"
    kernels(tmp_path, body, monkeypatch, name)
    with pytest.raises(FmuError, match=rf"{name}\.py:\d+: .*{words}"):
        library_text(name, True)


def test_what_callers_hand_in_is_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = "def f(x: Reals, out: Pairs, k: int) -> None:\n    out[k, 0] = x[k]\n"
    found = kernels(tmp_path, body, monkeypatch, "checked_arrays")
    good = np.zeros((3, 2))
    wrong: list[tuple[Any, str]] = [
        (np.zeros((3, 3)), r"`out` of the kernel f must be of shape \(n, 2\), but is of \(3, 3\)"),
        (np.zeros((2, 3)).T, "contiguous and writeable"),
        (np.zeros((3, 2), dtype=np.float32), "an array of float64, but is float32"),
        ([[0.0, 0.0]], "an array of float64, but is list"),
    ]
    for out, words in wrong:
        with pytest.raises(TypeError, match=words):
            found.f(np.zeros(3), out, 0)
    with pytest.raises(TypeError, match="`x` of the kernel f must be of float64, but is of complex128"):
        found.f(np.zeros(3, dtype=complex), good, 0)
    with pytest.raises(TypeError, match="must be given 3 arguments, but is given 2"):
        found.f(np.zeros(3), good)
    for x, k in ((np.zeros(3), 3), (np.zeros(3), -4), (np.zeros(0), 0)):
        with pytest.raises(IndexError, match="out of range"):
            found.f(x, good, k)
    found.f([1, 2, 3], good, -1)
    assert good[2, 0] == 3.0


def test_arithmetic_raises_or_goes_on_as_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = "def f(x: Reals, out: Reals) -> None:\n    out[0] = x[0] / x[1]\n    out[1] = math.exp(x[2])\n"
    found = kernels(tmp_path, body, monkeypatch, "arithmetic_arrays")
    out = np.zeros(2)
    with pytest.raises(ZeroDivisionError):
        found.f(np.array([1.0, 0.0, 0.0]), out)
    with pytest.raises(OverflowError):
        found.f(np.array([1.0, 1.0, 1e3]), out)
    Kernels("arithmetic_arrays", checked=False).f(np.array([-1.0, 0.0, 1e3]), out)
    assert out.tolist() == [-math.inf, math.inf]


# Random programs ------------------------------------------------------------------------------------------------

NAMES = st.sampled_from(["a", "b", "x[n]", "y[n]", "t[n, 1]", "t[m, 0]", "w[m]", "float(n)"])
NUMBERS = st.floats(-3.0, 3.0).map(repr)


def grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    pair = st.tuples(inner, inner)
    return st.one_of(
        pair.map(lambda p: f"({p[0]} + {p[1]})"), pair.map(lambda p: f"({p[0]} - {p[1]})"),
        pair.map(lambda p: f"({p[0]} * {p[1]})"), pair.map(lambda p: f"({p[0]} / (1.0 + abs({p[1]})))"),
        pair.map(lambda p: f"max({p[0]}, {p[1]})"), inner.map(lambda e: f"math.sin({e})"),
        inner.map(lambda e: f"math.sqrt(abs({e}))"),
        st.tuples(inner, inner, inner).map(lambda p: f"({p[0]} if {p[1]} > {p[2]} else {p[1]})"),
    )  # fmt: skip


EXPRESSIONS = st.recursive(st.one_of(NAMES, NUMBERS), grown, max_leaves=6)
TARGETS = st.sampled_from(["a", "b", "y[n]", "t[n, 0]", "t[m, 1]", "w[m]", "y[-1]"])
LINES = st.one_of(
    st.tuples(TARGETS, EXPRESSIONS).map(lambda p: f"{p[0]} = {p[1]}"),
    st.tuples(TARGETS, EXPRESSIONS).map(lambda p: f"{p[0]} += {p[1]}"),
    st.tuples(EXPRESSIONS, TARGETS, EXPRESSIONS).map(lambda p: f"if {p[0]} > 0.5:\n            {p[1]} = {p[2]}"),
)
COUNT = iter(range(1000))


EXAMPLES = 10 if settings.default.derandomize else 25  # by day, by night


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(programs=st.lists(st.lists(LINES, min_size=1, max_size=6), min_size=4, max_size=4))
@example(
    programs=[["a = math.sin(math.sqrt(abs(max(b, 0.20783536533066993))))"]]
)  # a constant, which compilers would compute
def test_random_programs_give_the_bits_of_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, programs: list[list[str]]
) -> None:
    """40 programs by day, 100 others each night, four in each library."""
    bodies = []
    for number, lines in enumerate(programs):
        text = "\n".join(f"        {line}" for line in lines)
        bodies.append(
            f"def f{number}(x: Reals, y: Reals, t: Pairs) -> float:\n    w = scratch(3)\n    a = 0.5\n    b = -1.25\n"
            f"    for n in range(len(x)):\n        m = n % 3\n{text}\n    return a - b\n"
        )
    name = f"random_arrays_{next(COUNT)}"
    head = HEAD.replace('["f"]', str([f"f{n}" for n in range(len(programs))]))
    (tmp_path / f"{name}.py").write_text(head + "\n".join(bodies))
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    found = Kernels(name, checked=False)
    rng = np.random.default_rng(len(name))
    for number in range(len(programs)):
        given_ = [rng.normal(size=7), rng.normal(size=7), rng.normal(size=(7, 2))]
        plain = [plain_array(a) for a in given_]
        try:
            expected = getattr(found.python, f"f{number}")(*plain)
        except (ArithmeticError, ValueError):  # where C goes on with infinities
            continue
        result = getattr(found, f"f{number}")(*given_)
        numbers = [result, *(n for a in given_ for n in a.ravel().tolist())]
        assert list(map(repr, numbers)) == list(map(repr, [expected, *(n for a in plain for n in a.tolist())]))


@pytest.mark.skipif(local_compiler() is None or sys.platform != "linux", reason="no C compiler with sanitizers")
def test_the_c_is_clean_under_sanitizers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program of C calls the kernel of MIXED within its arrays and with every length wrong."""
    kernels(tmp_path, MIXED, monkeypatch, "sane_arrays")
    calls = "\n".join(
        f"    call_f(x, {n}, t, {n}, 5, c, {k}, 3, 3, w, {n}, o, {m}, 2, 1, &result, &fault); seen += fault.kind;"
        for n, k, m in [(4, 3, 4), (3, 3, 4), (4, 1, 3), (1, 2, 4), (2, 1, 1)]
    )
    main = (
        "int main(void)\n{\n    Fault fault;\n    double result, x[4] = {1}, t[20] = {2}, c[27] = {3}, o[8];\n"
        f"    int64_t w[4] = {{0}};\n    int seen = 0;\n{calls}\n    return seen == 0;\n}}\n"
    )
    (tmp_path / "sane.c").write_text(library_text("sane_arrays", True) + main)
    for header in HEADERS:
        shutil.copy(header, tmp_path)
    compiler = local_compiler()
    assert compiler is not None
    flags = [f for f in FLAGS if f not in ("-shared", "-fPIC")]
    extra = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all"]
    subprocess.run([compiler, *flags, *extra, "-o", "sane", "sane.c", "-lm"], cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "sane"], check=False).returncode == 0


def test_plain_arrays_refuse_what_c_refuses() -> None:
    work = scratch(2, 3)
    for index in ((2, 0), (0, 3), (-3, 0)):
        with pytest.raises(IndexError):
            work[index] = 1.0
    with pytest.raises(IndexError, match="part"):
        work[0] = 1.0
