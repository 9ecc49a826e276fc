"""Signals that end a program, taken at points where they can neither be lost nor leave anything behind.

Python calls the handler of a signal between any two of its instructions. An exception raised there, such as
the KeyboardInterrupt of Ctrl-C, is dropped when it meets a finalizer or a callback, and may meet work half
done.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

INTERRUPTED = 130
"""Exit code of a command that Ctrl-C ended, as shells have it."""


@contextmanager
def noted_signals() -> Iterator[Callable[[], None]]:
    """Note signals inside; the function given calls the handler of one that came, and so does the end.

    A second signal before that is handled at once. Signals without a handler in Python end the process as
    before; outside the main thread nothing is noted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    noted: list[int] = []
    handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}

    def note(number: int, frame: FrameType | None) -> None:
        if noted:
            noted.clear()
            handlers[number](number, frame)
        else:
            noted.append(number)

    def take() -> None:
        if noted:
            number = noted.pop()
            handlers[number](number, None)

    try:
        for number in ENDING:
            handler = signal.getsignal(number)
            if callable(handler):
                handlers[number] = handler
                signal.signal(number, note)
        yield take
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        take()


@contextmanager
def blocked_interrupt() -> Iterator[None]:
    """Hold Ctrl-C back inside; processes and threads started there inherit that, and never see it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_as_exceptions() -> None:
    """For a command: Ctrl-C raises KeyboardInterrupt, SIGTERM and SIGHUP SystemExit, so that it cleans up.

    A signal that was ignored when the command began, as under nohup, stays ignored.
    """
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else _end)


def _end(number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)
