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
    │   └── OutputError           a place that cannot be written
    └── SimulationError           a run that went wrong: exit code 1
        ├── SlaveError            a slave refused or failed a call
        └── ConvergenceError      an iteration that did not converge
"""


class OrchestratorError(Exception):
    """Base of every error that the project raises on purpose; its text is one line for the user."""


class InputError(OrchestratorError):
    """What the user handed in is wrong."""


class ScenarioError(InputError):
    """A scenario, model or SSP file is wrong."""


class FmuError(InputError):
    """An FMU is missing, corrupt or not usable on this platform."""


class ConnectionMismatchError(InputError):
    """Two variables cannot be connected (name, causality, type or unit)."""


class RecordError(InputError):
    """A measured record is wrong."""


class DesignError(InputError):
    """A controller or an estimator does not exist for the given system."""


class CalibrationError(InputError):
    """A size or an experiment lies outside what a calibration covers."""


class OutputError(InputError):
    """A result cannot be written where it was asked for."""


class SimulationError(OrchestratorError):
    """A run went wrong."""


class SlaveError(SimulationError):
    """A slave refused or failed a call."""


class ConvergenceError(SimulationError):
    """An iteration did not converge within its stated limits."""
