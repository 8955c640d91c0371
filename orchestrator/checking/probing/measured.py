"""What was seen of how unknowns react to knowns, and what the description makes of it."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from orchestrator.checking.probing.job import ProbedUnknown
from orchestrator.checking.probing.movement import Values, distant
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import DiscardedError, StatusError, TerminatedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare
from orchestrator.errors import ChildError

declare("""
[dependencies]
dependency.missing | E | 2.2.8 | 2.4.8 | a variable that reacts to a known at once lists it among its dependencies | add it; hosts order their calls by that list
dependency.initial | E | 2.2.8 | 2.4.8 | a variable that reacts to a known in initialisation mode lists it in InitialUnknowns | add it; hosts initialise loops by that list
dependency.kind | E | 2.2.8 | 2.4.8 | factors are of the declared dependenciesKind | write dependent, or leave dependenciesKind out
dependency.superfluous | I | 2.2.8 | 2.4.8 | declared dependencies have an effect | check whether the value is used; if it is not, remove it from the list
""")  # noqa: E501

_SEEN = 1e-6  # of the size of a value: less is what an algebraic loop leaves
_SPREAD = 0.01  # of a quotient: more is no constant
_ALWAYS, _AT_A_POINT = ("constant", "fixed", "tunable"), ("discrete",)
"""Kinds of factors that are the same in a whole run, and between two events."""
_FEW_LISTED = 12  # more are taken for the list of all knowns, which tools write where they know nothing
_OFTEN = 3
_MOST_SILENT = 8
_MOST_NAMED = 10
_PIECE = 10  # steps
_WHERE = {
    "output": "Outputs", "rate": "Derivatives", "indicator": "EventIndicators", "initial": "InitialUnknowns",
}  # fmt: skip


class Measured:
    """What was seen of each pair of an unknown and a known."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.missing: dict[tuple[str, str], dict[str, str]] = {}
        self.tried: dict[tuple[str, str, str], int] = {}
        self.reacted: dict[tuple[str, str, str], int] = {}
        self.first: dict[str, str] = {}
        self.quotients: dict[tuple[str, str, str], list[tuple[float, float, str]]] = {}

    def look(
        self, unknowns: Sequence[ProbedUnknown], v: ProbedVariable, rows: list[list[Any]], change: float | None, at: str
    ) -> None:
        """Take the values of unknowns before and while a known has another value, by ``change`` if it is a number."""
        for u, before, during in _by_unknown(unknowns, rows):
            if u.variable.key == v.key:
                continue
            name = (u.section, u.variable.name, v.name)
            self.tried[name] = self.tried.get(name, 0) + 1
            listed = u.knowns is None or v.key in {k.key for k in u.knowns}
            if any(_reacts(u.variable, a, b) for a, b in zip(before, during, strict=True)):
                self.reacted[name] = self.reacted.get(name, 0) + 1
                if not listed:
                    self.missing.setdefault((u.section, u.variable.name), {}).setdefault(v.name, at)
            if listed and change and u.variable.real:
                for label, a, b in zip(u.variable.labels, before, during, strict=True):
                    if math.isfinite(b):
                        noise = 1e-12 * max(abs(a), abs(b)) / abs(change)
                        key = (u.section, label, v.name)
                        self.quotients.setdefault(key, []).append(((b - a) / change, noise, at))

    def report(self) -> None:
        """Hold what was seen against the description."""
        for (section, unknown), found in self.missing.items():
            names = ", ".join(f"`{name}`" for name in [*found][:_MOST_NAMED])
            more = f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
            pronoun = "it" if len(found) == 1 else "them"
            text = f"`{unknown}` reacts to {names}{more} at once, so its dependencies must list {pronoun}, but do not"
            rule = "dependency.initial" if section == "initial" else "dependency.missing"
            self.context.report(rule, text, unknown, f"({_WHERE[section]}, {next(iter(found.values()))})")
        for u in self.context.bench.job.unknowns:
            for known, kind in zip(u.knowns or (), u.kinds, strict=False):
                for label in u.variable.labels:
                    if self._judge_kind(u, label, known.name, kind):
                        break
        self._report_unmoved()
        self._report_silent()

    def look_first(self, unknowns: Sequence[ProbedUnknown], v: ProbedVariable, rows: list[list[Any]]) -> None:
        """Take the same at the first communication point, with the values of initialisation mode."""
        for u, before, during in _by_unknown(unknowns, rows):
            if any(_reacts(u.variable, a, b) for a, b in zip(before, during, strict=True)):
                self.first.setdefault(u.variable.name, v.name)

    def _report_unmoved(self) -> None:
        """Name outputs that react to a known right after initialisation mode, and in it to nothing."""
        if "value.stale" in self.context.remarked:
            return
        moving = {unknown for section, unknown, _ in self.reacted if section == "initial"}
        for unknown, known in self.first.items():
            if ("initial", unknown, known) in self.tried and unknown not in moving:
                text = f"`{unknown}` must follow `{known}` in initialisation mode too, but reacts to it only afterwards"
                self.context.report("value.stale", text, unknown)

    def _judge_kind(self, u: ProbedUnknown, label: str, known: str, kind: str) -> bool:
        """Whether a factor is not as constant as its kind says: in the whole run, at a point, or for all parameters."""
        found = self.quotients.get((u.section, label, known), [])
        states = self.context.bench.job.state_variables
        if kind == "constant" and states and all(v.initial == "exact" for v in states):
            # Then nothing is solved for in initialisation, which is looked at with other parameters too.
            found = [*found, *(q for q in self.quotients.get(("initial", label, known), []) if q[0])]
        groups = [found] if kind in _ALWAYS else []
        if kind in _AT_A_POINT:
            groups = [[q for q in found if q[2] == at] for at in dict.fromkeys(at for _, _, at in found)]
        for group in groups:
            if _differ(group):
                low, high = min(q for q, _, _ in group), max(q for q, _, _ in group)
                text = f"`{label}` must follow `{known}` by a {kind} factor, as dependenciesKind says"
                self.context.report("dependency.kind", f"{text}, but by {low:.4g} to {high:.4g}", u.variable.name)
                return True
        return False

    def _report_silent(self) -> None:
        """Name knowns that are listed and change nothing: at no point, and in no run."""
        bench, trace = self.context.bench, self.context.trace
        heard = {known for _, _, known in self.reacted} | self.context.heard
        if self.context.far is not None and bench.movement is self.context.far[0]:
            self.context.heard = frozenset(heard)  # what is silent here may be heard near the values of the file
            return
        often = {known for (_, _, known), count in self.tried.items() if count >= _OFTEN}
        listed = {k.key for u in self.narrow_unknowns() for k in u.knowns or ()}
        listed |= self._parameters_of_unlisted()
        movement = bench.movement
        states = {v.key for v in bench.job.state_variables or ()}
        silent: list[ProbedVariable] = []
        for v in movement.values:
            told = v.name in heard or v.name not in often or v.key not in listed
            chosen = v.real or (v.causality == "parameter" and v.base not in ("String", "Binary"))
            if told or v.key in states or not chosen:
                continue
            if trace is None or len(silent) >= _MOST_SILENT:
                return
            if self._is_silent(v, trace, [v.start or ()]):
                silent.append(v)
        names = [f"`{v.name}`" for v in silent if trace is None or self._is_silent(v, trace, distant(v))]
        if names:
            text = "what unknowns depend on, by a list or for want of one, must have an effect, but none was seen of "
            self.context.report("dependency.superfluous", f"{text}{', '.join(names)}, at three points and in a run")

    def _parameters_of_unlisted(self) -> set[tuple[str, int]]:
        """The parameters of a small FMU whose initial unknowns list nothing: they depend on all of them then."""
        job = self.context.bench.job
        found = {v.key for v in self.context.bench.movement.values if v.causality == "parameter"}
        everything = any(u.section == "initial" and u.knowns is None for u in job.unknowns)
        whole = job.stop is not None and job.start + (job.steps + 0.5) * job.step >= job.stop  # what comes later counts
        return found if everything and whole and len(found) <= _FEW_LISTED else set()

    def _is_silent(self, v: ProbedVariable, trace: list[list[Any]], values: Sequence[Values]) -> bool:
        """Whether runs with other values of a variable are all as the driven one; what is refused has an effect."""
        bench = self.context.bench
        movement = bench.movement
        bench.held = frozenset({v.key})
        try:
            for x in values:
                bench.movement = replace(movement, values={**movement.values, v: x})
                if not self._runs_as(trace):
                    return False
        except (StatusError, DiscardedError, TerminatedError):
            return False
        except ChildError:
            bench.library.renew()
            return False
        finally:
            bench.movement, bench.held = movement, frozenset()
        return True

    def _runs_as(self, trace: list[list[Any]]) -> bool:
        """Whether a run is as another one, looked at piece by piece, for most that differ do so soon."""
        bench = self.context.bench
        with bench.instance() as driver:
            for first in range(0, bench.job.steps, _PIECE):
                last = min(first + _PIECE, bench.job.steps)
                if self.context.compare(trace[first:last], bench.run(driver, first, last)) is not None:
                    return False
        return True

    def narrow_unknowns(self) -> list[ProbedUnknown]:
        """The unknowns that name what they depend on, without those that name everything."""
        unknowns = self.context.bench.job.unknowns
        return [u for u in unknowns if u.knowns is not None and len(u.knowns) <= _FEW_LISTED]


def _by_unknown(unknowns: Sequence[ProbedUnknown], rows: list[list[Any]]) -> Iterator[tuple[ProbedUnknown, Any, Any]]:
    """Each unknown with its values in both rows."""
    position = 0
    for u in unknowns:
        before, during = (row[position : position + u.variable.size] for row in rows)
        position += u.variable.size
        yield u, before, during


def _reacts(v: ProbedVariable, a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        size = max(abs(a), abs(b), 1e-6 * (v.nominal or 1.0))
        return math.isfinite(a) and math.isfinite(b) and abs(a - b) > _SEEN * size
    return bool(a != b)


def _differ(quotients: Sequence[tuple[float, float, str]]) -> bool:
    if len(quotients) < 2:
        return False
    low, high = min(quotients), max(quotients)
    size = max(abs(low[0]), abs(high[0]))
    return high[0] - low[0] > _SPREAD * size + 10.0 * max(noise for _, noise, _ in quotients)
