"""The command `mog`: ready for Ctrl-C before the package, whose imports take a moment, is there."""

import contextlib
import os
import signal
from types import FrameType
from typing import NoReturn


def main() -> None:
    """Entry point of the command."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    from mixed_order_game.cli.app import main as command

    command()


def _leave(number: int, _frame: FrameType | None) -> NoReturn:
    """End at once and without a traceback; nothing has been done yet."""
    with contextlib.suppress(OSError):
        os.write(2, b"mog: interrupted\n")
    os._exit(128 + number)
