"""One caller at a time: threads that share an object wait for each other."""

import os
from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from ..errors import SimulationError


class Turn:
    """The right to use an instance. Raises SimulationError where waiting for it would have no end."""

    def __init__(self) -> None:
        self._lock = RLock()
        self._process = os.getpid()
        self._taken = False

    def __enter__(self) -> None:
        if os.getpid() != self._process:  # after a fork no other thread is left to give the lock back
            self._process, self._lock = os.getpid(), RLock()
        self._lock.acquire()
        if self._taken:
            self._lock.release()
            raise SimulationError(
                "the simulator is in the middle of a run: functions that the run calls, and processes forked "
                "meanwhile, need a simulator of their own"
            )
        self._taken = True

    def __exit__(self, *_: object) -> None:
        self._taken = False
        self._lock.release()


class HasTurn(Protocol):
    """Something that one caller uses at a time."""

    _turn: Turn


Instance = TypeVar("Instance", bound=HasTurn)
Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


def in_turn(
    method: Callable[Concatenate[Instance, Arguments], Returned],
) -> Callable[Concatenate[Instance, Arguments], Returned]:
    """Let a method wait until no other thread is in one of these methods of the same instance."""

    @wraps(method)
    def waiting(self: Instance, /, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned:
        with self._turn:
            return method(self, *args, **kwargs)

    return waiting
