"""A loop with a gap, followed from sample to sample: a kernel."""

from orchestrator.building.translation.kernel_arrays import Reals, Table

__all__ = ["follow"]


def follow(
    gap: Table, contact: Table, sample: Table, state: Reals, moved: Reals, parts: int, i: float, twist: Reals,
    load: Reals,
) -> None:  # fmt: skip
    """Fill twist and load angle at each sample, over the half-gap.

    ``gap`` and ``contact`` (k, k) step one of the ``parts`` of a sample within the gap and on the upper flank; on the
    lower one all signs are turned. ``sample`` (k, k) is what the controller does at a sample. ``state`` (k,) is the
    plant's, the requests under way, and 1; it moves on in place, through the scratch ``moved`` (k,).
    """
    size = len(state)
    for n in range(len(load)):
        for r in range(size):
            total = 0.0
            for c in range(size):
                total += sample[r, c] * state[c]
            moved[r] = total
        for r in range(size):
            state[r] = moved[r]
        for _ in range(parts):
            phi = state[0] / i - state[2]
            for r in range(size - 1):
                total = 0.0
                if phi > 1.0:
                    for c in range(size):
                        total += contact[r, c] * state[c]
                elif phi < -1.0:
                    for c in range(size - 1):
                        total += contact[r, c] * state[c]
                    total -= contact[r, size - 1]
                else:
                    for c in range(size):
                        total += gap[r, c] * state[c]
                moved[r] = total
            for r in range(size - 1):
                state[r] = moved[r]
        twist[n] = state[0] / i - state[2]
        load[n] = state[2]
