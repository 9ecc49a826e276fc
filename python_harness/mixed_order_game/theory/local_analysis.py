"""The analysis of a game with expressions: near x*, where its loop is linear, and over a box around x*."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..fmu.model import Value
from ..fmu.run import Simulator
from ..game.definition import Expressions, named_parts
from ..game.equilibrium import has_affine_gradients
from .box_analysis import box_analysis
from .findings import Analysis, Progress, Row
from .growing_modes import AT_LEAST, Stability, stability
from .linearized import linearized_loop


def local_analysis(
    fmu: Path,
    source: Path,
    changes: Mapping[str, Value],
    *,
    box: float | None,
    speed: float | None,
    radius: float,
    progress: Progress | None = None,
) -> Analysis:
    """Spectrum and monotonicity at x*, said to be local, and the theorems with the constants of a box.

    source is what the user named; box, speed and radius are those of `box_analysis`.

    Raises SimulationError as linearized_loop does.
    """
    report = progress or (lambda _name, _part: None)
    with Simulator(fmu) as simulator:
        model = simulator.model
        changes = model.expanded(changes)
        report("linearizing", 0.0)
        loop = linearized_loop(simulator, changes)
    monotonicity = float(np.linalg.eigvalsh(0.5 * (loop.jacobian + loop.jacobian.T))[0])
    linear = has_affine_gradients(fmu, model.expressions)
    where = "" if linear else " at x*"
    kind = "strongly monotone" if monotonicity > 0.0 else "not strongly monotone"
    norm = float(np.linalg.norm(loop.jacobian, 2))
    rows = [
        Row("local", "m", monotonicity, "1", f"smallest eigenvalue of the symmetric part of h{where}"),
        Row("local", "||h||", norm, "1", f"norm of the gradients' Jacobian h{where}"),
        Row("local", "states", loop.states, "1", "of the unperturbed loop"),
    ]
    report("eigenvalues", 0.0)
    if loop.is_large:
        judged = stability(loop.game)
        if judged.rate > 0.0:
            rows.append(Row("local", "slowest rate", judged.rate, "1/s", AT_LEAST))
    else:
        abscissa = loop.abscissa
        judged = _by_abscissa(abscissa)
        rows.append(Row("local", "slowest rate", -abscissa, "1/s", "minus the spectral abscissa"))
    if judged.stable is not None:
        meaning = f"unperturbed loop exponentially stable{where}"
        rows.insert(3, Row("local", "stable", judged.stable, "1", meaning))
    report("box", 0.0)
    found = box_analysis(model, loop.x_star, changes, box=box, speed=speed, radius=radius)
    report("box", 1.0)
    return Analysis(
        title=model.title,
        path=source,
        rows=(*rows, *found.rows),
        hypotheses=found.hypotheses,
        demonstrations=found.demonstrations,
        verdicts=(
            _subject(model.expressions, linear=linear),
            _stability(judged, where),
            f"The pseudo-gradient is {kind}{where}: m = {monotonicity:.4g}.",
            *found.verdicts,
        ),
        constants=None,
        exact=None,
        runs={},
        bounds=found.bounds,
    )


def _subject(expressions: Expressions, *, linear: bool) -> str:
    told = named_parts(expressions)
    if linear:
        return f"Expressions in {told}: what follows is of the unperturbed loop, which is linear."
    return f"Expressions in {told}: what follows is of the loop linearized at x*, and holds near x* alone."


def _by_abscissa(abscissa: float) -> Stability:
    if abscissa < 0.0:
        return Stability(stable=True, told=f"slowest rate {-abscissa:.4g} 1/s")
    if abscissa > 0.0:
        return Stability(stable=False, told=f"an eigenvalue has real part {abscissa:.4g} 1/s")
    return Stability(stable=None, told="the spectral abscissa is zero to rounding")


def _stability(judged: Stability, where: str) -> str:
    begin = "Without perturbation"
    if judged.stable is None:
        return f"{begin} stability{where} is not decided: {judged.told}."
    if judged.stable:
        near = " near x*, from a start that is close enough to it" if where else ""
        return f"{begin} these gains converge exponentially{near}: {judged.told}."
    return f"{begin} these gains do not converge{where}: {judged.told}."
