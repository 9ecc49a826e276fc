"""Temporary folders, and what to tell when the place for them is full or runs no programs."""

import atexit
import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from ..errors import MixedOrderGameError, reason

PREFIX = "mixed-order-game-"
HINT = "set the environment variable TMPDIR to another folder"


def new_folder(error: type[MixedOrderGameError]) -> Path:
    """A new temporary folder. Raises the error."""
    try:
        return Path(tempfile.mkdtemp(prefix=PREFIX))
    except OSError as found:
        raise error(f"there is no place for temporary files: {reason(found)}; {HINT}") from found


@contextmanager
def temporary_folder(error: type[MixedOrderGameError]) -> Iterator[Path]:
    """A new temporary folder, removed afterwards. Raises the error if none can be made."""
    folder = new_folder(error)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@cache
def folder_of_process() -> Path:
    """A temporary folder that is removed when this process ends. Raises MixedOrderGameError."""
    folder, process = new_folder(MixedOrderGameError), os.getpid()

    def remove() -> None:
        if os.getpid() == process:  # and not in a forked copy of it
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


def explained(error: Exception, folder: Path) -> str:
    """Why something failed in a temporary folder, with the way out where its place is to blame."""
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{folder.parent} is full; {HINT}"
    if str(error).startswith("Failed to load shared library") and _runs_nothing(folder):  # fmpy's words
        return f"{folder.parent} is mounted noexec, so that no library in it can be loaded; {HINT}"
    return reason(error)


def _runs_nothing(folder: Path) -> bool:
    return hasattr(os, "statvfs") and bool(os.statvfs(folder).f_flag & os.ST_NOEXEC)
