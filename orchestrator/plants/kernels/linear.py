"""The transition of a linear plant, repeated at every sample: a kernel."""

from orchestrator.building.translation.kernel_arrays import Pairs, Reals, Table, Wholes

__all__ = ["repeat"]


def repeat(
    x: Reals, phi: Table, by_early: Reals, by_late: Reals, early: Reals, late: Reals, shown: Wholes, moved: Reals,
    out: Pairs,
) -> None:  # fmt: skip
    """Fill ``out`` with two states at every sample.

    Args:
        x: (k,) state, moved on in place.
        phi: (k, k) transition.
        by_early: (k,) what the first torque of a sample does.
        by_late: (k,) what the second one does.
        early: (n,) [N.m].
        late: (n,) [N.m].
        shown: (2,) places of the states in ``out``, -1: zero.
        moved: (k,) scratch.
        out: (n, 2) filled.
    """
    for n in range(len(late)):
        for c in range(2):
            out[n, c] = x[shown[c]] if shown[c] >= 0 else 0.0
        for i in range(len(x)):
            total = by_early[i] * early[n] + by_late[i] * late[n]
            for j in range(len(x)):
                total += phi[i, j] * x[j]
            moved[i] = total
        for i in range(len(x)):
            x[i] = moved[i]
