"""The two-stage drivetrain solved independently: SciPy's integrator from one located event to the next.

It shares no code with the plants. Dry friction is Coulomb's: a body slides, or it is held while the torque on it stays
below its friction. Parameters are a mapping with the names of the FMU ``TwoStageTrain``.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
P = Mapping[str, float]
Events = list[tuple[Any, Callable[..., Any]]]

BODIES = ("motor", "shaft", "load")
TOLERANCE, SMALLEST = 1e-12, 1e-14
LONGEST = 0.1  # of the shortest oscillation's radian, so that no brief contact hides within a step of the integrator


def longest_step(p: P) -> float:
    """Return how long a step of the integrator may be [s]."""
    first = p["k_1"] * (1.0 / (p["J_m"] * p["i_1"] ** 2) + 1.0 / p["J_s"])
    second = p["k_2"] * (1.0 / (p["J_s"] * p["i_2"] ** 2) + 1.0 / p["J_l"])
    return float(LONGEST / np.sqrt(first + second))


def start_values(p: P) -> Array:
    """Return the initial states: angle and speed of motor, intermediate shaft and load, and the motor's torque."""
    names = ("theta_m", "omega_m", "theta_s", "omega_s", "theta_l", "omega_l", "T_m")
    return np.array([p.get(f"{name}_start", 0.0) for name in names])


def twists_of(x: Array, p: P) -> tuple[float, float]:
    return x[0] / p["i_1"] - x[2], x[2] / p["i_2"] - x[4]


def torques_of(x: Array, flanks: tuple[int, int], p: P) -> tuple[float, float]:
    """The torques of both stages; a flank is 2 where there is no gap."""
    d, r = twists_of(x, p), twists_of(np.array([x[1], 0.0, x[3], 0.0, x[5]]), p)
    found = []
    for n, flank in enumerate(flanks):
        at = 0.0 if flank == 2 else flank * p[f"alpha_{n + 1}"]
        found.append(p[f"k_{n + 1}"] * (d[n] - at) + p[f"c_{n + 1}"] * r[n] if flank else 0.0)
    return found[0], found[1]


def drives(x: Array, flanks: tuple[int, int], p: P, T_l: float) -> Array:
    """The torques on the three bodies without dry friction."""
    one, two = torques_of(x, flanks, p)
    return np.array(
        [
            x[6] - p["b_m"] * x[1] - one / p["i_1"],
            one - p["b_s"] * x[3] - two / p["i_2"],
            two - p["b_l"] * x[5] - T_l - p.get("effects.load_torque.torque", 0.0),
        ]
    )


def dry(p: P) -> Array:
    return np.array([p.get(f"effects.coulomb_friction.{body}.torque", 0.0) for body in BODIES])


def rates_of(x: Array, flanks: tuple[int, int], slides: tuple[int, ...], p: P, u: float, T_l: float) -> Array:
    push = drives(x, flanks, p, T_l) - np.array(slides) * dry(p)
    inertias = np.array([p["J_m"], p["J_s"], p["J_l"]])
    speed = np.where(np.array(slides) == 0, 0.0, push / inertias)
    return np.array([x[1], speed[0], x[3], speed[1], x[5], speed[2], (u - x[6]) / p["tau"]])


def flank_of(twist: float, alpha: float) -> int:
    if alpha <= 0.0:
        return 2
    return 1 if twist > alpha else -1 if twist < -alpha else 0


def slides_of(x: Array, flanks: tuple[int, int], p: P, T_l: float) -> tuple[int, ...]:
    push, level = drives(x, flanks, p, T_l), dry(p)
    found = []
    for n in range(3):
        speed = x[2 * n + 1]
        moves = speed if speed != 0.0 else push[n] if abs(push[n]) > level[n] else 0.0
        found.append((1 if moves >= 0.0 else -1) if level[n] == 0.0 else int(np.sign(moves)))
    return tuple(found)


def events_of(
    flanks: tuple[int, int], slides: tuple[int, ...], p: P, T_l: float
) -> list[tuple[Any, Callable[..., Any]]]:
    """What may end a mode, with the functions whose roots are the instants."""
    found: Events = []

    def add(kind: Any, value: Callable[[Array], float]) -> None:
        def event(t: float, x: Array) -> float:
            return float(value(x))

        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        found.append((kind, event))

    for n, flank in enumerate(flanks):
        alpha = p[f"alpha_{n + 1}"]
        if flank == 0:
            for side in (1, -1):
                add(("flank", n, side), lambda x, n=n, side=side, alpha=alpha: alpha - side * twists_of(x, p)[n])
        elif flank != 2:
            add(("flank", n, 0), lambda x, n=n, flank=flank, alpha=alpha: flank * twists_of(x, p)[n] - alpha)
    for n, level in enumerate(dry(p)):
        if level > 0.0 and slides[n] == 0:
            add(("breaks", n, 0), lambda x, n=n, level=level: level - abs(drives(x, flanks, p, T_l)[n]))
        elif level > 0.0:
            add(("stops", n, 0), lambda x, n=n: slides[n] * x[2 * n + 1])
    return found


def solve_two_stages(p: P, u: Array, T_l: Array, step: float) -> tuple[Array, Array, list[float]]:
    """Return the states at each sample (n + 1, 7), the flanks that touch (n + 1, 2), and the instants of contact [s].

    Args:
        p: parameters by name.
        u: (n,) request, held over each sample [N.m].
        T_l: (n,) load torque, held too [N.m].
        step: [s].
    """
    x = start_values(p)
    alphas = (p["alpha_1"], p["alpha_2"])
    flanks = tuple(flank_of(twist, alpha) for twist, alpha in zip(twists_of(x, p), alphas, strict=True))
    states, touched, instants = [x], [flanks], []
    slides: tuple[int, ...] = slides_of(x, flanks, p, T_l[0])
    for n in range(len(u)):
        level = dry(p)
        now, end = n * step, (n + 1) * step
        while now < end:
            # What is held breaks away at once where the load or a contact has changed.
            push = drives(x, flanks, p, T_l[n])
            slides = tuple(
                int(np.sign(push[b])) if slides[b] == 0 and abs(push[b]) > level[b] * (1.0 + 1e-12) else slides[b]
                for b in range(3)
            )
            kinds = events_of(flanks, slides, p, T_l[n])
            answer = solve_ivp(
                lambda t, y, n=n, f=flanks, s=slides: rates_of(y, f, s, p, u[n], T_l[n]),
                (now, end), x, method="DOP853", rtol=TOLERANCE, atol=SMALLEST, max_step=longest_step(p),
                events=[event for _, event in kinds],
            )  # fmt: skip
            now, x = float(answer.t[-1]), answer.y[:, -1].copy()
            if answer.status != 1:
                continue
            kind, which, side = next(k for (k, _), times in zip(kinds, answer.t_events, strict=True) if len(times))
            if kind == "flank":
                flanks = tuple(side if m == which else flank for m, flank in enumerate(flanks))
                instants.append(now)
            elif kind == "stops":
                x[2 * which + 1] = 0.0
                push = drives(x, flanks, p, T_l[n])
                after = int(np.sign(push[which])) if abs(push[which]) > level[which] else 0
                slides = tuple(after if m == which else slide for m, slide in enumerate(slides))
            else:
                push = drives(x, flanks, p, T_l[n])
                slides = tuple(int(np.sign(push[m])) if m == which else slide for m, slide in enumerate(slides))
        states.append(x)
        touched.append(flanks)
    return np.array(states), np.array(touched), instants
