"""A slave that misbehaves on request, built by PythonFMU as it comes, without anything of ours.

``y`` is the integral of ``gain``. From the fifth step on the slave does what ``fault`` says: 1 raises, 2 hangs, 3
crashes the process, 4 returns NaN, 5 leaks 20 MB per step, 6 ends the process, 7 refuses the step, 8 prints, 9 hangs
holding the interpreter lock.
"""

import ctypes
import os
import sys
import time

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Integer, Real

RAISES, HANGS, CRASHES, NAN, LEAKS, EXITS, REFUSES, PRINTS, HANGS_LOCKED = range(1, 10)
QUIET_STEPS = 4
hoard: list[bytes] = []


class Faulty(Fmi2Slave):
    """An integrator with faults."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.gain = 1.0
        self.fault = 0
        self.y = 0.0
        self.steps = 0
        self.register_variable(Real("gain", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Integer("fault", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Real("y", causality=Fmi2Causality.output, initial=Fmi2Initial.calculated))

    def do_step(self, current_time, step_size):
        """Integrate, or fail."""
        self.y += self.gain * step_size
        self.steps += 1
        return self.steps <= QUIET_STEPS or self.misbehave()

    def misbehave(self):
        """Do what ``fault`` says; return whether the step was taken."""
        if self.fault == RAISES:
            raise ValueError("the slave raises")
        if self.fault == HANGS:
            time.sleep(3600.0)
        if self.fault == CRASHES:
            ctypes.string_at(0)
        if self.fault == NAN:
            self.y = float("nan")
        if self.fault == LEAKS:
            hoard.append(b"x" * 20_000_000)
        if self.fault == EXITS:
            os._exit(0)
        if self.fault == PRINTS:
            sys.stdout.write("noise\n")
            sys.stderr.write("noise\n")
        if self.fault == HANGS_LOCKED:
            ctypes.PyDLL(None).sleep(3600)
        return self.fault != REFUSES
