"""Makes an FMU from a game file: the host tool writes modelDescription.xml, packaging makes the archive.

Every game shares the compiled binaries; no compiler is needed. The package carries, in its folder `_native`,
tools/<platform>/ with mixed-order-game-description (the host tool), binaries/<platform>/, documentation/,
licenses/ and model.png, for this machine's platform or for all of them; in its folder `games` the game files.
"""

import difflib
import hashlib
import logging
import os
import platform
import re
import shutil
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol, runtime_checkable

from ..errors import BuildError, GameError, MissingGameError, ResultError, reason
from ..files.reading import expect_file, suffix_of
from ..files.temporary import HINT, explained, folder_of_process, temporary_folder
from ..files.writing import FMU, check_folder, check_output, write_file, write_whole
from .packaging import PackagingError, write_fmu

logger = logging.getLogger(__name__)

DEFAULT_GAME = "five_vehicles"
"""The paper's example."""

BY_NAME = "the name of a game of the package"
GAME = f"a game file (.toml) or {BY_NAME}"
SOURCE = f"an FMU (.fmu), {GAME}"
SOURCE_OR_RESULT = f"an FMU (.fmu), a result (.parquet, .csv), {GAME}"

TOOL = "mixed-order-game-description"
ARM_LINUX = "aarch64-linux"


@runtime_checkable
class GameObject(Protocol):
    """A game that is no file, such as a mixed_order_game.Game: it makes its own FMU."""

    def build(self) -> Path:
        """Its FMU."""


GameSource = Path | str | GameObject | None
"""An FMU or a game: a file, a game of the package by its name, an object, None for the paper's example."""


def build_fmu(
    game: Path | str, output: Path | str, *, arm_linux: bool | None = None, force: bool = False
) -> Path:
    """Make the FMU of a game. No compiler is needed; equal inputs give equal bytes.

    It holds the libraries of all platforms that the package carries.

    Parameters
    ----------
    game
        A game file (.toml) or a game of the package by its name.
    output
        The FMU (.fmu). It replaces an FMU of a game.
    arm_linux
        Whether it is for 64-bit Arm Linux alone: its library then lies in linux64 too, where most importers
        look. Default: on such a machine.
    force
        Whether any file but the game is replaced.

    Returns
    -------
    Path
        `output`.

    Raises
    ------
    GameError
        If the file is missing (a FileNotFoundError, too) or breaks the definition of a game.
    BuildError
        If the installation lacks the compiled parts, or the archive cannot be written or does not replace the
        file.

    Examples
    --------
    >>> mog.build_fmu("rivalling_pairs", "rivals.fmu").name
    'rivals.fmu'
    """
    game, output = game_file(game), Path(output)
    expect_file(game, "game file", GameError)
    try:
        check_output(output, FMU, inputs=[game], force=force)
        with _archive(game, arm_linux=arm_linux) as archive, archive.open("rb") as made:
            return write_file(
                output, FMU, lambda file: shutil.copyfileobj(made, file), inputs=[game], force=force
            )
    except ResultError as error:
        raise BuildError(str(error)) from error


@contextmanager
def _archive(game: Path, *, arm_linux: bool | None = None) -> Iterator[Path]:
    """The FMU of a game in a temporary folder. Raises as build_fmu does."""
    native = native_directory()
    with temporary_folder(BuildError) as folder:
        archive, description = folder / "game.fmu", folder / "modelDescription.xml"
        extra = folder / "extra"
        try:
            extra.mkdir()
            _describe(game, description, extra)
            write_fmu(
                archive,
                model_description=description,
                game=game,
                binaries=_binaries(
                    native, arm_linux=(_platform() == ARM_LINUX) if arm_linux is None else arm_linux
                ),
                documentation=native / "documentation",
                licenses={path.name: path for path in sorted((native / "licenses").iterdir())},
                icon=native / "model.png",
                extra=extra,
            )
        except PackagingError as error:
            raise BuildError(f"cannot make the FMU of {game}: {error}") from error
        except OSError as error:
            raise BuildError(f"cannot make the FMU of {game}: {explained(error, folder)}") from error
        yield archive


def default_fmu() -> Path:
    """Make the FMU of the paper's example once and keep it in the user's cache folder.

    Returns
    -------
    Path
        The FMU.

    Raises
    ------
    BuildError
        As `build_fmu` does.

    Examples
    --------
    >>> mog.default_fmu().name
    'MixedOrderGame.fmu'
    """
    return cached_fmu(default_game())


def cached_fmu(game: Path | str) -> Path:
    """Make the FMU of a game once and keep it in the user's cache folder.

    The entry's name holds a fingerprint of the game, the compiled parts and the documentation, so that a
    changed file gives a new FMU; a damaged entry is made again. Where the cache cannot be written, the FMU
    lies in a temporary folder until the process ends.

    Parameters
    ----------
    game
        A game file (.toml) or a game of the package by its name.

    Returns
    -------
    Path
        The FMU.

    Raises
    ------
    GameError, BuildError
        As `build_fmu` does.

    Examples
    --------
    >>> mog.cached_fmu("five_vehicles") == mog.default_fmu()
    True
    """
    import platformdirs

    game = game_file(game)
    expect_file(game, "game file", GameError)
    fingerprint = hashlib.sha256(game.read_bytes())
    native = native_directory()
    fingerprint.update(_platform().encode())
    for path in sorted(path for path in native.rglob("*") if path.is_file()):
        fingerprint.update(path.relative_to(native).as_posix().encode() + b"\0" + path.read_bytes())
    cache = platformdirs.user_cache_path("mixed-order-game")
    entry = Path(fingerprint.hexdigest()[:16]) / "MixedOrderGame.fmu"
    if cache.is_absolute():  # it is not where nobody's home is known
        with suppress(ResultError):  # of a cache that is full, read-only or another user's
            return _kept(game, cache / entry)
    try:
        return _kept(game, folder_of_process() / entry)
    except ResultError as error:
        raise BuildError(f"{error}; {HINT}") from error


def _kept(game: Path, output: Path) -> Path:
    """The FMU of a game at a place of our own. Raises ResultError if it cannot be written there."""
    if _intact(output):
        logger.debug("the FMU of %s is in the cache: %s", game, output)
    else:
        logger.info("making the FMU of %s: %s", game, output)
        check_folder(output.parent)
        with _archive(game) as archive, archive.open("rb") as made:
            write_whole(output, lambda file: shutil.copyfileobj(made, file))
    return output


def _intact(fmu: Path) -> bool:
    """Whether there is an archive of which no part is missing or damaged."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            return archive.testzip() is None
    except (OSError, EOFError, RuntimeError, ValueError, zipfile.BadZipFile, zlib.error):
        return False


def default_game() -> Path:
    """Find the game file of the paper's example.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    BuildError
        If the installation lacks it.

    Examples
    --------
    >>> mog.default_game().name
    'five_vehicles.toml'
    """
    return shipped_game(DEFAULT_GAME)


def shipped_game(name: str) -> Path:
    """Game file that comes with the package, by name without suffix.

    Raises GameError if there is no such game, BuildError if this installation carries none at all.
    """
    return _by_name(name, SOURCE)


def _by_name(name: str, expected: str) -> Path:
    games = shipped_games()
    if name not in games:
        known = f"; those that come with the package are {', '.join(games)}"
        raise MissingGameError(f"there is no game {name}{_nearest(name, expected) or known}")
    return games[name]


def _nearest(name: str, expected: str) -> str:
    """The end of a sentence: files of this name with a suffix that is expected, and the nearest games."""
    files = [f"{name}{suffix}" for suffix in re.findall(r"\.\w+", expected)]
    found = [file for file in files if os.path.isfile(file)]  # noqa: PTH113 - never raises
    found += difflib.get_close_matches(name.lower(), shipped_games(), n=3)
    return f"; did you mean {' or '.join(found)}?" if found else ""


def shipped_games() -> dict[str, Path]:
    """Game files that come with the package, by name. Raises BuildError if this installation carries none."""
    found = (path for folder in _package_folders() for path in (folder / "games").glob("*.toml"))
    games = {path.stem: path for path in sorted(found)}
    if not games:
        raise BuildError("this installation carries no games: install the package mixed-order-game with pip")
    return games


def source_of(game: GameSource, expected: str = SOURCE) -> Path:
    """The FMU or game file meant: a file, a game of the package by its name, the paper's example for None.

    Of a game object it is its FMU.

    Raises GameError, which ends with what is expected, for anything else; whether a file exists is not asked.
    """
    if game is None:
        return default_game()
    if isinstance(game, GameObject):
        return game.build()
    path = Path(game)
    if suffix_of(path) in (".fmu", ".toml"):
        return path
    if str(path) in shipped_games():
        return shipped_game(str(path))
    if os.path.isdir(path):  # noqa: PTH112 - never raises, here as below
        raise GameError(f"{path} is a folder, expected {expected}")
    if path.suffix:
        raise GameError(f"{path} ends in {path.suffix}, expected {expected}")
    if os.path.exists(path):  # noqa: PTH110
        nearest = _nearest(str(path), expected)
        raise GameError(f"{path} is a file without a suffix, expected {expected}{nearest}")
    return _by_name(str(path), expected)


def game_file(game: GameSource) -> Path:
    """The game file meant, as source_of does. Raises GameError for an FMU as well."""
    path = source_of(game, GAME)
    if suffix_of(path) == ".fmu":
        raise GameError(f"{path} is an FMU, expected {GAME}")
    return path


def fmu_of(game: GameSource, expected: str = SOURCE) -> Path:
    """The FMU meant, as source_of does; a game is made into one and kept in the cache."""
    path = source_of(game, expected)
    return path if suffix_of(path) == ".fmu" else cached_fmu(path)


def native_directory() -> Path:
    """Folder of the compiled parts. Raises BuildError if this installation has none."""
    for folder in _package_folders():
        if (folder / "_native").is_dir():
            return folder / "_native"
    raise BuildError(
        "this installation carries no compiled FMU: install the package mixed-order-game with pip"
    )


def host_tool() -> Path:
    """The program that judges games and writes modelDescription.xml. Raises BuildError if there is none."""
    folder = native_directory() / "tools"
    tool = folder / _platform() / (TOOL + (".exe" if _platform() == "win64" else ""))
    if not tool.is_file():
        raise BuildError(f"this installation carries no host tool for {_platform()}: {tool} is missing")
    return tool


def native_library() -> Path:
    """The shared library of this package's FMUs on this machine. Raises BuildError if there is none."""
    found = _binaries(native_directory(), arm_linux=False)
    if _platform() not in found:
        raise BuildError(f"this installation has binaries for {', '.join(found)}, but none for {_platform()}")
    return found[_platform()]


def _package_folders() -> Iterator[Path]:
    """Folders of the package; an editable installation has two, the sources and the compiled parts."""
    yield from map(Path, sys.modules[__package__.partition(".")[0]].__path__)


def _platform() -> str:
    """This machine's name among the folders of binaries and tools."""
    named = {"Windows": "win64", "Darwin": "darwin64"}.get(platform.system(), "linux64")
    return ARM_LINUX if named == "linux64" and platform.machine() in {"aarch64", "arm64"} else named


def _binaries(native: Path, *, arm_linux: bool) -> dict[str, Path]:
    found = {path.parent.name: path for path in sorted(native.glob("binaries/*/MixedOrderGame.*"))}
    if not found:
        raise BuildError(f"there is no binary below {native / 'binaries'}")
    if not arm_linux:
        return found
    if ARM_LINUX not in found:
        raise BuildError(f"this installation has binaries for {', '.join(found)}, but none for {ARM_LINUX}")
    return dict.fromkeys((ARM_LINUX, "linux64"), found[ARM_LINUX])


def _describe(game: Path, output: Path, extra: Path) -> None:
    """Run the host tool, which writes the description and, below extra, reference results.

    It exits with 1 and one sentence on stderr for a bad game.
    """
    tool = host_tool()
    command = [str(tool), str(game), "--output", str(output), "--extra", str(extra)]
    try:
        finished = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", check=False
        )
    except OSError as error:
        raise BuildError(f"cannot run {tool}: {reason(error)}") from error
    said = " ".join(finished.stderr.split())
    if said.startswith((f"{TOOL}: cannot write", f"{TOOL}: filesystem error")):
        raise BuildError(f"{said}; {HINT}")
    if finished.returncode == 1:
        raise GameError(said)
    if finished.returncode != 0 or not output.is_file():
        raise BuildError(f"{tool.name} ended with status {finished.returncode}: {finished.stderr.strip()}")
