"""One closed loop of native FMUs under the master, for calibration: without numba, whose compiling takes half a minute.

Each thread has slaves of its own; their steps are machine code that leaves the interpreter's lock alone.
"""

import threading
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.paired.cosimulation import LoopSession
from orchestrator.paired.experiment import Experiment

Array = NDArray[np.float64]
ESTIMATED_LOAD = 2


class NativeLoop:
    """The loop of an experiment, to be closed.

    Args:
        fmus: paths of the three native FMUs.
    """

    def __init__(self, experiment: Experiment, fmus: Mapping[str, Path]) -> None:
        self.experiment = experiment
        self._fmus = fmus
        self._own = threading.local()
        self._sessions: list[LoopSession] = []

    def run(self, alpha: float, errors: tuple[Array, Array]) -> Array:
        """Run once; may be called by any thread.

        Args:
            alpha: half-gap [rad].
            errors: errors [rad] of both encoders, each of shape (steps + 1,).

        Returns:
            Shape (steps + 1, 3); column 2 is the estimated load angle [rad], the others are zero.
        """
        session = getattr(self._own, "session", None)
        if session is None:
            session = self._own.session = LoopSession(self.experiment, self._fmus, ("theta_l_hat",))
            self._sessions.append(session)
        out = np.zeros((self.experiment.steps + 1, ESTIMATED_LOAD + 1))
        out[:, ESTIMATED_LOAD] = session.run(alpha, errors)["theta_l_hat"]
        return out

    def close(self) -> None:
        """Release the slaves."""
        for session in self._sessions:
            session.close()
