"""Gains of a sampled linear-quadratic regulator of five states and one input, on the standard library alone.

The discrete Riccati equation is solved by structured doubling (Chu, Fan, Lin and Wang, Int. J. Control 77(8), 2004):
with ``G = B B' / R`` and ``H = Q``, and ``W = I + G H``,

    A <- A W^-1 A,   G <- G + A W^-1 G A',   H <- H + A' H W^-1 A

``H`` converges quadratically to the stabilising solution ``X``; the gains are ``K = B' X A / (R + B' X B)``.
Matrices are lists of 25, row after row.
"""

from typing import Annotated

from .lqr import Gains

ORDER = 5
SIZE = 25
Square = Annotated[list[float], 25]
Column = tuple[float, float, float, float, float]

# Each doubling squares what is left of the closed loop's slowest mode: poles of 1 - 1e-12 are settled.
MOST_DOUBLINGS = 50
SETTLED = 1e-15


def product(a: Square, b: Square) -> Square:
    """Return ``a b``."""
    made: Square = [0.0] * SIZE
    for r in range(ORDER):
        for c in range(ORDER):
            for n in range(ORDER):
                made[r * ORDER + c] += a[r * ORDER + n] * b[n * ORDER + c]
    return made


def transpose(a: Square) -> Square:
    """Return ``a'``."""
    made: Square = [0.0] * SIZE
    for r in range(ORDER):
        for c in range(ORDER):
            made[r * ORDER + c] = a[c * ORDER + r]
    return made


def symmetric_sum(a: Square, b: Square) -> Square:
    """Return the symmetric part of ``a + b``."""
    made: Square = [0.0] * SIZE
    for r in range(ORDER):
        for c in range(ORDER):
            here, there = r * ORDER + c, c * ORDER + r
            made[here] = 0.5 * ((a[here] + b[here]) + (a[there] + b[there]))
    return made


def largest(a: Square) -> float:
    """Return the largest magnitude in ``a``."""
    most = 0.0
    for n in range(SIZE):
        most = max(most, abs(a[n]))
    return most


def left_divide(w: Square, a: Square) -> Square:
    """Return ``w^-1 a`` (Gauss and Jordan, each column's pivot its largest item)."""
    left: Square = list(w)
    right: Square = list(a)
    for k in range(ORDER):
        pivot = k
        for r in range(k + 1, ORDER):
            if abs(left[r * ORDER + k]) > abs(left[pivot * ORDER + k]):
                pivot = r
        for c in range(ORDER):
            here, there = k * ORDER + c, pivot * ORDER + c
            above, below = left[there], left[here]
            left[here] = above
            left[there] = below
            above, below = right[there], right[here]
            right[here] = above
            right[there] = below
        scale = left[k * ORDER + k]
        for c in range(ORDER):
            left[k * ORDER + c] /= scale
            right[k * ORDER + c] /= scale
        for r in range(ORDER):
            factor = left[r * ORDER + k]
            if r != k:
                for c in range(ORDER):
                    left[r * ORDER + c] -= factor * left[k * ORDER + c]
                    right[r * ORDER + c] -= factor * right[k * ORDER + c]
    return right


def regulator_gains(A: Square, B: Column, weights: Column, input_weight: float) -> Gains:
    """Return the gains ``K`` of ``u = -K x`` that minimise the sum of ``x' Q x + R u^2``."""
    F: Square = list(A)
    G: Square = [0.0] * SIZE
    H: Square = [0.0] * SIZE
    for r in range(ORDER):
        H[r * ORDER + r] = weights[r]
        for c in range(ORDER):
            G[r * ORDER + c] = B[r] * B[c] / input_weight
    settled = False
    for _ in range(MOST_DOUBLINGS):
        W: Square = product(G, H)
        for n in range(ORDER):
            W[n * ORDER + n] += 1.0
        V = left_divide(W, F)
        T = transpose(F)
        gained = product(T, product(H, V))
        G = symmetric_sum(G, product(F, product(left_divide(W, G), T)))
        H = symmetric_sum(H, gained)
        F = product(F, V)
        if largest(gained) <= SETTLED * largest(H):
            settled = True
            break
    if not settled:
        raise ValueError("the regulator's Riccati equation must have a stabilising solution for these weights")
    return gains_of(H, A, B, input_weight)


def gains_of(X: Square, A: Square, B: Column, input_weight: float) -> Gains:
    """Return ``B' X A / (R + B' X B)``."""
    pushed: Square = [0.0] * ORDER
    gains: Square = [0.0] * ORDER
    whole = input_weight
    for c in range(ORDER):
        for n in range(ORDER):
            pushed[c] += B[n] * X[n * ORDER + c]
        whole += pushed[c] * B[c]
    for c in range(ORDER):
        for n in range(ORDER):
            gains[c] += pushed[n] * A[n * ORDER + c]
    return (gains[0] / whole, gains[1] / whole, gains[2] / whole, gains[3] / whole, gains[4] / whole)
