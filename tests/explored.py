"""The page of mog explore, served by the command in a process of its own."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

Served = tuple[str, int]
"""Host and port."""


@contextmanager
def served_page(*arguments: Path | str) -> Iterator[Served]:
    """Start mog explore with these arguments, without a browser, and end it as Ctrl-C does."""
    command = [sys.executable, "-m", "mixed_order_game", "explore", *map(str, arguments)]
    command += ["--no-browser", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = urlsplit(process.stdout.readline().strip())
            yield str(address.hostname), int(address.port or 0)
        finally:
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, "mog: interrupted\n")
