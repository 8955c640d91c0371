"""Variables as the probes see them."""

from orchestrator.checking.probing.variables import ProbedVariable


def test_whole_limits_beyond_what_a_float_holds_stay_exact():
    """2**63 - 1 as a float is 2**63, which no Int64 holds: the probe of limits would blame the FMU for it."""
    low, high = -(2**53) - 1, 2**63 - 1
    one = ProbedVariable("count", 1, "Int64", "parameter", "fixed", "exact", (0,), low, high, None)
    assert one.limits == (low, high)
