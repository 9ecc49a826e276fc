"""The analysis of a game with expressions: near x*, where its loop is linear, and over a box around x*."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import GameError
from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.definition import PARTS, Expressions
from .box_analysis import box_analysis
from .findings import Analysis, Row
from .linearized import gradient_jacobian, linearized_loop


def local_analysis(
    fmu: Path,
    source: Path,
    changes: Mapping[str, Value],
    *,
    box: float | None,
    speed: float | None,
    radius: float,
) -> Analysis:
    """Spectrum and monotonicity at x*, said to be local, and the theorems with the constants of a box.

    source is what the user named; box, speed and radius are those of `box_analysis`.

    Raises ModelError and SimulationError as linearized_loop does, GameError if there is no such x*.
    """
    with Simulator(fmu) as simulator:
        model = simulator.model
        values = model.start_values(changes)
        loop = linearized_loop(simulator, changes)
        if not np.isfinite(loop.x_star).all():
            raise GameError(f"{source}: the FMU knows no Nash equilibrium to linearize at")
    h = gradient_jacobian(loop, model, values)
    monotonicity = float(np.linalg.eigvalsh(0.5 * (h + h.T))[0])
    abscissa = loop.abscissa
    where = " at x*" if "cost" in model.expressions else ""
    rows = (
        Row("local", "m", monotonicity, "1", f"smallest eigenvalue of the symmetric part of h{where}"),
        Row("local", "||h||", float(np.linalg.norm(h, 2)), "1", f"norm of the gradients' Jacobian h{where}"),
        Row("local", "states", len(loop.states), "1", "of the unperturbed loop"),
        Row("local", "stable", abscissa < 0.0, "1", f"unperturbed loop exponentially stable{where}"),
        Row("local", "slowest rate", -abscissa, "1/s", "minus the spectral abscissa"),
    )
    found = box_analysis(fmu, loop.x_star, changes, box=box, speed=speed, radius=radius)
    kind = "strongly monotone" if monotonicity > 0.0 else "not strongly monotone"
    verdicts = (
        _subject(model.expressions),
        _stability(abscissa, where),
        f"The pseudo-gradient is {kind}{where}: m = {monotonicity:.4g}.",
        *found.verdicts,
    )
    return Analysis(
        title=model.title,
        path=source,
        rows=(*rows, *found.rows),
        hypotheses=found.hypotheses,
        demonstrations=found.demonstrations,
        verdicts=verdicts,
        constants=None,
        exact=None,
        runs={},
        bounds=found.bounds,
    )


def _subject(expressions: Expressions) -> str:
    told = " and ".join(PARTS[part] for part in expressions)
    if "cost" in expressions:
        return (
            f"Expressions in {told}: what follows is of the loop linearized at x*, and holds near x* alone."
        )
    return f"Expressions in {told}: what follows is of the unperturbed loop, which is linear."


def _stability(abscissa: float, where: str) -> str:
    begin = "Without perturbation"
    if abscissa < 0.0:
        near = " near x*, from a start that is close enough to it" if where else ""
        return f"{begin} these gains converge exponentially{near}: slowest rate {-abscissa:.4g} 1/s."
    if abscissa > 0.0:
        return f"{begin} these gains do not converge{where}: an eigenvalue has real part {abscissa:.4g} 1/s."
    return f"{begin} stability{where} is not decided: the spectral abscissa is zero to rounding."
