"""A short run of the fuzzer; ``benchmarks/fuzz_check.py`` is the long one, which looks at the time too."""

import random
import sys
from pathlib import Path

import pytest

from benchmarks.fuzz_check import one_case
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMU is built with a C compiler on Linux"
)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.night) for n in (1, 2, 3))])
def test_damage_gives_findings_and_nothing_else(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    codes = [one_case(rng, tmp_path, run_share=0.05)[0] for _ in range(40)]
    assert 0 < sum(codes) <= len(codes)
