"""What the host tool answers about a game: checked, judged, bounded."""

import json
import subprocess
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import BuildError, GameError, ModelError, reason
from ..files.reading import suffix_of
from ..files.temporary import temporary_folder
from ..fmu.build import host_tool


def ask(option: str, game: Path, request: str = "") -> Any:
    """The answer, JSON, to an option about a game file; the request goes to the tool's standard input.

    Raises GameError, with the tool's sentence, where it has no answer because the game is none; BuildError if
    the installation lacks the tool or it fails.
    """
    tool = host_tool()
    try:
        finished = subprocess.run(
            [str(tool), option, str(game)],
            input=request,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            check=False,
        )
    except OSError as error:
        raise BuildError(f"cannot run {tool}: {reason(error)}") from error
    if finished.stdout and finished.returncode in (0, 1):
        return json.loads(finished.stdout)
    if finished.returncode == 1:
        raise GameError(" ".join(finished.stderr.split()))
    raise BuildError(f"{tool.name} ended with status {finished.returncode}: {finished.stderr.strip()}")


@contextmanager
def file_of(source: Path) -> Iterator[Path]:
    """The game file itself, or a copy of that which an FMU holds. Raises ModelError for what is no FMU."""
    if suffix_of(source) == ".toml":
        yield source
        return
    with temporary_folder(BuildError) as folder:
        file = folder / "game.toml"
        try:
            with zipfile.ZipFile(source) as archive:
                file.write_bytes(archive.read("resources/game.toml"))
        except (OSError, EOFError, KeyError, RuntimeError, ValueError, zipfile.BadZipFile) as error:
            raise ModelError(f"{source} cannot be read as an FMU of a game: {reason(error)}") from error
        yield file
