"""An effect attached to an FMU: the same arithmetic as in the loop that fitted it, one communication step at a time.

``AttachedEffect`` stands between a signal and an input (or behind an output), adds the force of a law of
:mod:`laws.body` to it, lies in a connection between two FMUs, or sets a parameter that changes.
It is built with PythonFMU into each corrected system.
"""

from collections.abc import Mapping
from math import exp
from xml.etree.ElementTree import Element

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

from ..laws.body import across, built_up, cuts, distance_of, has_memory, resistance

FEEDBACK = "feedback"
SERIES = (
    "gain", "offset", "delay", "lag", "saturation", "dead_zone", "rate_limit", "quantisation", "drift", "dependence",
    "connection", "late_reading",
)  # fmt: skip


class AttachedEffect(Fmi2Slave):
    """One effect; ``series`` -1: feedback by ``law``, else a place in ``SERIES``.

    Inputs: ``signal``, what the effect acts on; ``position`` and ``velocity`` of a port. Output: ``result``.
    ``lead``: communication steps by which the fed-back signals are extrapolated: 0.5 where the effect runs before the
    FMU within a step (Gauss-Seidel), 1.5 where all run side by side (Jacobi). ``at_rest``: what comes in was zero
    before the start, and not what it is at first.
    """

    def __init__(self, **kwargs):  # type: ignore[no-untyped-def]
        super().__init__(**kwargs)
        self.default_experiment = DefaultExperiment(0.0, 1.0)
        self.signal = self.position = self.velocity = self.result = 0.0
        self.series, self.law, self.sign, self.lead = -1, 0, 1.0, 0.5
        self.q0 = self.q1 = self.q2 = self.q3 = 0.0
        self.has_velocity = self.at_rest = False
        for name in ("signal", "position", "velocity"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        self.register_variable(Real("result", causality=Fmi2Causality.output))
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        for name in ("q0", "q1", "q2", "q3", "sign", "lead"):
            self.register_variable(Real(name, **fixed))
        for name in ("series", "law"):
            self.register_variable(Integer(name, **fixed))
        for name in ("has_velocity", "at_rest"):
            self.register_variable(Boolean(name, **fixed))
        self._forget()

    def _forget(self) -> None:
        self._steps, self._built, self._x, self._v, self._held = 0, 0.0, 0.0, 0.0, 0.0
        self._past: list[float] = []
        self._fed = (0.0, 0.0)

    def to_xml(self, model_options: Mapping[str, str] | None = None) -> Element:
        """Return the model description: what arrives is computed over a step and follows no input at once."""
        root = super().to_xml({} if model_options is None else model_options)
        for unknown in root.iterfind("ModelStructure/Outputs/Unknown"):
            unknown.set("dependencies", "")
        return root

    def exit_initialization_mode(self) -> None:
        """Start anew."""
        self._forget()
        changes = self.series >= 0 and SERIES[self.series] in ("drift", "dependence")
        self.result = self.q1 if changes else self.signal

    def do_step(self, time: float, step: float) -> bool:
        """Compute what arrives over a step of ``step`` from ``time`` [s], of what is sent at its start."""
        kind = FEEDBACK if self.series < 0 else SERIES[self.series]
        if kind == FEEDBACK and cuts(self.law):
            self.result = across(self.law, self.signal, self._ahead(self.position), self.sign, self.q0)
        elif kind == FEEDBACK:
            self.result = self.signal - self.sign * self._force(step)
        elif kind == "connection":
            self.result = self.q0 * self._ahead(self._current()) + self.q1
        elif kind == "drift":
            self.result = self.q1 + self.q0 * (time + 0.5 * step - self.q2)
        else:
            self.result = self._through(self.signal, step)
        self._steps += 1
        return True

    def _current(self) -> float:
        """Return what is handed on as it is now: it depends by ``q2`` on what was fed for the step before."""
        fed, self._fed = self._fed, (self.position, self._fed[0])
        if self._steps < 2:
            return self.signal
        return self.signal + self.q2 * 0.5 * (self.position - fed[0])

    def _ahead(self, x: float) -> float:
        """Return a value extrapolated by ``lead`` steps."""
        before = self._x if self._steps > 0 else x
        self._x = x
        return x + self.lead * (x - before)

    def _force(self, step: float) -> float:
        x = self.position
        before = self._x if self._steps > 0 else x
        if self.has_velocity:
            v, ahead, known = self.velocity, self.lead, self._steps > 0
        else:
            v, ahead, known = (x - before) / step, self.lead + 0.5, self._steps > 1
        old = self._v if known else v
        middle, place = v + ahead * (v - old), x + self.lead * (x - before)
        half = 0.0
        if has_memory(self.law):
            distance = distance_of(self.law, self.q1, self.q3)
            half = built_up(self.law, self._built, middle, distance, 0.5 * step)
            self._built = built_up(self.law, self._built, middle, distance, step)
        self._x, self._v = x, v
        return resistance(self.law, place, middle, (v - old) / step, half, self.q0, self.q1, self.q2)

    def _through(self, u: float, step: float) -> float:
        kind, value = SERIES[self.series], self.q0
        if self._steps == 0:
            self._held = 0.0 if self.at_rest else u
            self._past = [0.0] if self.at_rest else []
        if kind == "gain":
            return u * (1.0 + value)
        if kind == "dependence":
            return self.q1 + value * (u - self.q2)
        if kind == "offset":
            return u + value
        if kind == "saturation":
            return min(max(u, -value), value)
        if kind == "dead_zone":
            return u - min(max(u, -value), value)
        if kind == "quantisation":
            return value * round(u / value) if value > 0.0 else u
        if kind == "delay":
            return self._delayed(u, step, value)
        if kind == "late_reading":
            return self._late(u, step, value)
        if kind == "lag":
            if value <= 0.0:
                return u
            decay, gap = exp(-step / value), self._held - u
            self._held = u + gap * decay
            return u + gap * value / step * (1.0 - decay)
        return self._limited(u, step, value)

    def _delayed(self, u: float, step: float, delay: float) -> float:
        """Return the mean over this step of what was sent ``delay`` earlier, each value held over its step."""
        self._past.append(u)
        whole = int(delay / step)
        share = delay / step - whole
        last = len(self._past) - 1
        newer, older = self._past[max(last - whole, 0)], self._past[max(last - whole - 1, 0)]
        if last > whole + 2:
            del self._past[0]
        return (1.0 - share) * newer + share * older

    def _late(self, u: float, step: float, delay: float) -> float:
        """Return what was to be read ``delay`` earlier, by a cubic through four samples.

        ``q1``: steps in a sample of the inputs: where it is 3 or more, no cubic reaches beyond a jump of these.
        """
        self._past.append(u)
        now, per_sample = self._steps + 1, int(self.q1)
        if len(self._past) > int(delay / step) + per_sample + 5:
            del self._past[0]
        oldest = now - len(self._past) + 1
        place = max(now - delay / step, float(oldest))
        first = int(place) - 1
        if per_sample >= 3:
            begin = per_sample * int(place / per_sample)
            first = min(max(first, begin), begin + per_sample - 3)
        first = min(max(first, oldest), now - 3)
        if first < oldest:
            return self._past[int(place) - oldest]
        t, (a, b, c, d) = place - first, self._past[first - oldest : first - oldest + 4]
        ends = d * t * (t - 1) * (t - 2) / 6 - a * (t - 1) * (t - 2) * (t - 3) / 6
        return ends + b * t * (t - 2) * (t - 3) / 2 - c * t * (t - 1) * (t - 3) / 2

    def _limited(self, u: float, step: float, rate: float) -> float:
        gap = u - self._held
        time = abs(gap) / rate
        if time >= step:
            begin = self._held
            self._held = begin + (rate * step if gap > 0.0 else -rate * step)
            return 0.5 * (begin + self._held)
        self._held = u
        return u - gap * 0.5 * time / step
