"""The analysis of a game file or an FMU, as a function."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ..arguments import number_argument
from ..errors import BuildError, GameError
from ..files.reading import ReadError, expect_file, read_text, suffix_of, toml_of
from ..files.temporary import temporary_folder
from ..fmu.build import build_fmu, cached_fmu, source_of
from ..fmu.model import Value, read_model
from ..game.definition import expressions_of, has_expressions, with_defaults
from .analyst import Analyst, Progress
from .findings import Analysis
from .game import AnalysedGame, game_from_tables, read_game, toml_text, without_square
from .local_analysis import local_analysis


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

    Of a game with expressions, the loop linearized at x* alone is analysed; simulation and radius do nothing.
    """
    radius = number_argument(radius, "radius", GameError)
    if not (math.isfinite(radius) and radius > 0.0):
        raise GameError(f"radius = {radius:g} is not positive")
    source = source_of(game)
    expression = _expression_in(source)
    if expression:
        if not square:
            raise GameError(f"{source}: only coefficients have a square term to remove; {expression}")
        file = source if suffix_of(source) == ".fmu" else cached_fmu(source)
        return local_analysis(file, source, changes or {})
    with _opened(source, changes, simulation=simulation, square=square) as (analysed, fmu):
        return Analyst(analysed, fmu, changes or {}, radius, progress).analysis(source)


def _expression_in(path: Path) -> str | None:
    """Whose cost, dynamics or disturbance has an expression; None also for files that are no games."""
    if suffix_of(path) == ".fmu":
        return has_expressions(read_model(path).expressions)
    expect_file(path, "game file", GameError)
    try:
        return has_expressions(expressions_of(with_defaults(toml_of(read_text(path)))))
    except (ReadError, KeyError, TypeError, AttributeError):  # read_game tells what is wrong with it
        return None


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
