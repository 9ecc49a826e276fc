"""The analysis of a game file or an FMU, as a function."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ..arguments import number_argument
from ..errors import BuildError, GameError
from ..files.reading import suffix_of
from ..files.temporary import temporary_folder
from ..fmu.build import build_fmu, cached_fmu, source_of
from ..fmu.model import Value
from .analyst import Analyst, Progress
from .findings import Analysis
from .game import AnalysedGame, game_from_tables, read_game, toml_text, without_square


def analyse(
    game: Path | str | None,
    *,
    changes: Mapping[str, Value] | None = None,
    simulation: bool = True,
    square: bool = True,
    radius: float = 0.1,
    progress: Progress | None = None,
) -> Analysis:
    """Analyse an FMU (.fmu), a game file (.toml), a game of the package by its name, the paper's for None.

    changes: start values in place of the FMU's own. simulation: run the FMU with the game's gains and with
    the designed ones. square = False: the same game with the square terms of g removed. radius: lim sup of
    |x - x*| that the designed gains are to guarantee, in the game's length unit. progress is called with
    the name of a step and the part of it done.

    Raises GameError, ModelError, BuildError, VariableError or SimulationError as reading, building and
    running do; GameError if the game has no unique Nash equilibrium or radius is not positive.
    """
    radius = number_argument(radius, "radius", GameError)
    if not (math.isfinite(radius) and radius > 0.0):
        raise GameError(f"radius = {radius:g} is not positive")
    source = source_of(game)
    with _opened(source, changes, simulation=simulation, square=square) as (analysed, fmu):
        return Analyst(analysed, fmu, changes or {}, radius, progress).analysis(source)


@contextmanager
def _opened(
    path: Path, changes: Mapping[str, Value] | None, *, simulation: bool, square: bool
) -> Iterator[tuple[AnalysedGame, Path | None]]:
    """The game and, where one is needed, its FMU."""
    needs_fmu = simulation or bool(changes)
    if square:
        if suffix_of(path) == ".fmu" or not needs_fmu:
            yield read_game(path, changes), path if simulation else None
            return
        read_game(path)
        fmu = cached_fmu(path)
        yield read_game(fmu, changes), fmu if simulation else None
        return
    tables = without_square(read_game(path).tables)
    if not needs_fmu:
        yield game_from_tables(tables, path), None
        return
    with temporary_folder(BuildError) as folder:
        derived = folder / "game.toml"
        derived.write_text(toml_text(tables), encoding="utf-8")
        fmu = build_fmu(derived, derived.with_suffix(".fmu"))
        yield read_game(fmu, changes), fmu if simulation else None
