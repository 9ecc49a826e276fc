"""The analysis of a game file or an FMU, as a function."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import replace

from ..arguments import number_argument
from ..errors import BuildError, GameError
from ..files.temporary import temporary_folder
from ..fmu.build import GameSource, build_fmu, fmu_of, source_of
from ..fmu.model import Model, Value, read_model
from ..game.definition import has_expressions
from ..game.parts import toml_of_game
from .analyst import Analyst
from .findings import Analysis, Progress
from .game import game_of_model, without_square
from .local_analysis import local_analysis


def analyse(
    game: GameSource = None,
    *,
    changes: Mapping[str, Value] | None = None,
    simulation: bool = True,
    square: bool = True,
    radius: float = 0.1,
    box: float | None = None,
    speed: float | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Judge a game's gains: thresholds of the theorems, exact spectrum, guaranteed radius, and runs.

    Of a game whose costs, dynamics or disturbances have expressions, the loop linearized at x* is analysed,
    and the theorems with constants that are proved over a box around x*; simulation then does nothing.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        when left out.
    changes
        Start values in place of the FMU's own.
    simulation
        Whether the FMU is run with the game's gains and with the designed ones.
    square
        False: the same game with the square terms of the unknown dynamics removed.
    radius
        lim sup of |x - x*| that the designed gains are to guarantee, in the game's length unit.
    box
        Of games with expressions: constants hold where every action is within this distance of x*, in each
        coordinate; by default as far as the starts, nearer where m > 0 is not proved there.
    speed
        Of games whose dynamics depend on velocities: constants hold where no velocity's coordinate is larger,
        in the game's length unit per s; by default as at the start, larger where the designed gains ask it.
    progress
        Called with the name of a step and the part of it done, 0 to 1.

    Returns
    -------
    Analysis
        Verdicts in plain words, figures by section, hypotheses, designs.

    Raises
    ------
    GameError
        For a game that is missing, is none or has no unique Nash equilibrium, and for a radius, box or
        speed that is not positive; for a box or speed of a game of coefficients, which needs none, and for a
        speed where no dynamics depend on velocities.
    ModelError, BuildError, VariableError, SimulationError
        As reading, building and running do.

    Examples
    --------
    >>> found = mog.analyse("energy_consumption", simulation=False)
    >>> round(found.exact.abscissa, 3)  # of the unperturbed loop, 1/s
    -2.096
    """
    radius = number_argument(radius, "radius", GameError)
    if box is not None:
        box = number_argument(box, "box", GameError)
    if speed is not None:
        speed = number_argument(speed, "speed", GameError)
    if not (math.isfinite(radius) and radius > 0.0):
        raise GameError(f"radius = {radius:g} is not positive")
    source = source_of(game)
    file = fmu_of(source)
    model = read_model(file)
    expression = has_expressions(model.expressions)
    if expression:
        if not square:
            raise GameError(f"{source}: only coefficients have a square term to remove; {expression}")
        return local_analysis(
            file, source, changes or {}, box=box, speed=speed, radius=radius, progress=progress
        )
    if box is not None or speed is not None:
        raise GameError(f"{source} is a game of coefficients, whose constants need neither box nor speed")
    with nullcontext(model) if square else _without_square(model) as model:
        analyst = Analyst(
            replace(game_of_model(model, changes), path=source),
            model if simulation else None,
            changes or {},
            radius,
            progress,
        )
        return analyst.analysis(source)


@contextmanager
def _without_square(model: Model) -> Iterator[Model]:
    """The same game with every square term of the unknown dynamics removed."""
    with temporary_folder(BuildError) as folder:
        derived = folder / "game.toml"
        derived.write_text(toml_of_game(without_square(model.game)), encoding="utf-8")
        yield read_model(build_fmu(derived, derived.with_suffix(".fmu")))
