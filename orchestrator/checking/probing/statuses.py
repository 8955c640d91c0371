"""What a call of FMI may return, and what is raised where it is not what was wanted."""

from orchestrator.errors import ChildError

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


class StatusError(Exception):
    """A call returned something else than was wanted.

    Attributes:
        function, status: what was called and what came back.
        rule: the rule that is broken, where that is no matter of the status.
    """

    def __init__(self, function: str, status: int, detail: str, rule: str = "") -> None:
        super().__init__(detail)
        self.function = function
        self.status = status
        self.rule = rule


class SkippedError(Exception):
    """A probe does not apply to this FMU; the text says why."""


class TerminatedError(Exception):
    """The slave asks for the simulation to end, or cannot be followed further; that is no fault.

    Its text, where it has one, says that the step was not done, which a first one must be.
    """


class DiscardedError(Exception):
    """A step was discarded, which is allowed, and was not done in shorter ones either.

    Attributes:
        again: whether shorter ones can be tried, in a run that saves a state before each step.
    """

    def __init__(self, detail: str, again: bool = False) -> None:
        super().__init__(detail)
        self.again = again


def odd(function: str) -> ChildError:
    """The error of an answer that a function cannot have."""
    return ChildError(f"the answer to {function} is not valid", "protocol")
