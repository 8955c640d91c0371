"""Intermediate updates of FMI 3.0: an FMU asks inside a step for the values of its inputs."""

import ctypes
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_bool, c_double, c_void_p
from typing import Any

import numpy as np

from orchestrator.errors import SlaveError
from orchestrator.fmi.access import Access
from orchestrator.fmi.batches import Functions, VariableBatch
from orchestrator.fmi.messages import WARNING

CALLBACK = ctypes.CFUNCTYPE(
    None, c_void_p, c_double, c_bool, c_bool, c_bool, c_bool, POINTER(c_bool), POINTER(c_double)
)
"""``fmi3IntermediateUpdateCallback``."""


class IntermediateUpdates:
    """What one instance is told inside its steps. Nothing can be raised there, but after the step.

    Attributes:
        callback: to be handed over at instantiation, and kept as long.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self.callback = CALLBACK(self._update)
        self._batches: list[VariableBatch] = []
        self._buffer = np.empty(0)
        self._values: Callable[[float], Sequence[float]] | None = None
        self._failure: BaseException | None = None

    def feed(
        self, functions: Functions, accesses: Sequence[Access], values: Callable[[float], Sequence[float]] | None
    ) -> None:
        """Say what inputs are inside steps, from now on: ``values`` at a time [s]; None: inputs are held."""
        self._buffer = np.empty(len(accesses))
        self._batches = functions.batches(accesses, "Set", self._buffer)
        self._values = values

    def take_failure(self) -> BaseException | None:
        """Return what went wrong inside the step that has just been done, and forget it."""
        failure, self._failure = self._failure, None
        return failure

    def _update(
        self, _: int, time: float, wants: bool, gives: bool, done: bool, may_return: bool, early: Any, until: Any
    ) -> None:
        early[0] = False
        if not wants or self._values is None or self._failure is not None:
            return
        try:
            self._buffer[:] = self._values(time)
            for batch in self._batches:
                self._set(batch, time)
        except BaseException as error:  # an exception must not reach the FMU
            self._failure = error

    def _set(self, batch: VariableBatch, time: float) -> None:
        batch.take(self._buffer)
        status = batch.call()
        if status > WARNING:
            raise SlaveError(f"{self._name}: {batch.function} inside a step at t = {time:g} s was refused")
