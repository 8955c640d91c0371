"""The exceptions of the project.

::

    OrchestratorError
    ├── InputError                what the user handed in is wrong: exit code 2
    │   ├── ScenarioError         a scenario, model or SSP file
    │   ├── FmuError              an FMU that is missing, corrupt or not usable here
    │   ├── ConnectionMismatchError  two variables that must not be connected
    │   ├── RecordError           a measured record
    │   ├── DesignError           a system for which no controller or estimator exists
    │   ├── CalibrationError      a size or an experiment outside a calibration
    │   ├── KernelError           machine code that is needed and cannot be made
    │   └── OutputError           a place that cannot be written
    └── SimulationError           a run that went wrong: exit code 1
        ├── SlaveError            a slave refused or failed a call
        ├── ChildError            a child process that ran foreign code ended, or broke a limit
        └── ConvergenceError      an iteration that did not converge
            └── ChatteringError   events that do not come to an end at one time
"""

from orchestrator.plain_text import plain_text, shorten


class OrchestratorError(Exception):
    """Base of every error that the project raises on purpose; its text is one line for the user.

    Texts hold names and messages from files and libraries: line breaks in them become spaces, what a terminal
    would act on is written as an escape, and of long ones the middle is left out.

    Args:
        text: it calls arguments by their names in Python, in backticks.
        arguments: those names, so that a caller with other names (a command and its flags) can put its own there.
    """

    def __init__(self, text: str = "", *arguments: str) -> None:
        super().__init__(shorten(plain_text(text if text.isprintable() else " ".join(text.split()))))
        self.arguments = arguments


class InputError(OrchestratorError):
    """What the user handed in is wrong."""


class ScenarioError(InputError):
    """A scenario, model or SSP file is wrong."""


class FmuError(InputError):
    """An FMU is missing, corrupt or not usable on this platform."""


class ConnectionMismatchError(InputError):
    """Two variables cannot be connected (name, causality, type or unit)."""


class RecordError(InputError):
    """A measured record is wrong; the text may say how to read it differently."""

    def __init__(self, text: str = "", *arguments: str) -> None:
        super().__init__(text, *(arguments or ("model", "part", "resample", "rate")))


class DesignError(InputError):
    """A controller or an estimator does not exist for the given system."""


class CalibrationError(InputError):
    """A size or an experiment lies outside what a calibration covers."""


class KernelError(InputError):
    """Machine code is needed, and this machine has nothing that makes it."""


class OutputError(InputError):
    """A result cannot be written where it was asked for."""


class SimulationError(OrchestratorError):
    """A run went wrong."""


class SlaveError(SimulationError):
    """A slave refused or failed a call."""


class ChildError(SimulationError):
    """A child process that ran foreign code ended, or broke a limit.

    Attributes:
        reason: ``exit``, ``signal``, ``time``, ``memory``, ``disk``, ``threads`` or ``protocol``.
        code: exit code, number of the signal, or the time that there was [s].
        said: the last line that it printed, untrusted.
    """

    def __init__(self, text: str, reason: str = "exit", code: float = 0, said: str = "") -> None:
        super().__init__(text)
        self.reason, self.code, self.said = reason, code, said

    def explain(self, what: str) -> str:
        """Return what was to be and why it is not, where users say by `time_limit` how long ``what`` may take."""
        if self.reason == "time":
            return f"{what} must take at most {self.code:g} s (`time_limit`), but takes longer"
        return f"{what} must come to its end, but {self}{word_printed(self.said)}"


def word_printed(said: str) -> str:
    """Return the last line that a child process printed, as an addition to a text; empty for none."""
    return f" (it printed: {said})" if said else ""


class ConvergenceError(SimulationError):
    """An iteration did not converge within its stated limits."""


class ChatteringError(ConvergenceError):
    """Events at one time do not come to an end: slaves ask for another instant, or report another event, for ever."""
