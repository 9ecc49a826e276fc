"""What is known of the point x* at which all gradients of a game vanish, as its file states the game.

The host tool judges: by the second derivatives at x*, by interval evaluation of them around it, and by
searches from other starts.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..files.reading import expect_file
from ..fmu.build import GameSource, source_of
from .definition import Expressions, has_expressions
from .host_tool import ask, file_of

FloatArray = NDArray[np.float64]

LISTED = 4
"""Most entries of a joint action that a sentence shows."""


class Kind(StrEnum):
    """What x* is."""

    NASH = "Nash equilibrium"  # every cost is proved convex in its player's own action
    LOCAL = "local Nash equilibrium"  # no player gains by a small change of its own action
    OPEN = "second-order condition open"  # neither is known


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """x* and what is known of it. N players, D coordinates."""

    kind: Kind
    x_star: FloatArray  # (N, D)
    curvature: FloatArray  # (N,), the smallest eigenvalue of d^2 f_i / dx_i^2 at x*
    convex_within: FloatArray
    """(N,): f_i is proved convex in x_i where no coordinate is farther from x* than this; infinite where it
    is so wherever it is defined, 0 where nothing is proved"""
    kinks: tuple[str, ...]
    """(N,): the text of a condition of f_i that switches at x*; empty without one"""
    monotonicity: float  # m, of the pseudo-gradient's Jacobian at x*
    is_affine: bool
    """All own gradients are affine, so that m holds everywhere and they vanish together at x* alone"""
    others: tuple[FloatArray, ...]  # equilibria in the same sense, (N, D) each
    undefined_at_start: tuple[int, ...]
    """Players, from 1 on, whose gradient is not finite at their first estimates"""

    @property
    def sentence(self) -> str:
        """What x* is, and how that is known."""
        if self.kind is Kind.NASH and self.is_affine:
            return (
                "x* is the only Nash equilibrium: all gradients are affine, and every cost is convex in its "
                "player's own action."
            )
        if self.kind is Kind.NASH:
            return "x* is a Nash equilibrium: every cost is convex in its player's own action."
        if self.kind is Kind.LOCAL:
            within = float(self.convex_within.min())
            if within > 0.0:
                told = f"no player gains by moving alone, by at most {within:.3g} in each coordinate"
            else:
                told = "no player gains by a small move alone, by the second derivatives at x*"
            return f"x* is a local Nash equilibrium: {told}."
        open_one = int(np.argmin(np.where(self.convex_within > 0.0, np.inf, self.curvature))) + 1
        for player, kink in enumerate(self.kinks, start=1):
            if kink and not self.convex_within[player - 1] > 0.0:
                return (
                    f'The second-order condition is open: "{kink}" in the cost of player {player} switches '
                    "at x*, where its second derivatives jump."
                )
        return (
            "The second-order condition is open: the derivatives at x* do not tell whether the cost of "
            f"player {open_one} has a minimum along its own action there."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the theorems do not expect, one sentence each."""
        told = [self.sentence] if self.kind is Kind.OPEN else []
        if not self.monotonicity > 0.0:
            where = "" if self.is_affine else " at x*"
            told.append(
                f"The pseudo-gradient is not strongly monotone{where}, as the theorems suppose: "
                f"m = {self.monotonicity:.3g}."
            )
        if self.others:
            count = "another equilibrium" if len(self.others) == 1 else f"{len(self.others)} other equilibria"
            told.append(
                f"Other starts lead to {count}, such as {_shown(self.others[0])}; x* is "
                f"{_shown(self.x_star)}, found from equilibrium.guess, or from x0 without one."
            )
        undefined = (
            f"The gradient of player {player}'s cost is not finite at its first estimates: no run starts "
            "there. Give y0, and z0 to players of order 1, at which the cost is defined (both are 0 without)."
            for player in self.undefined_at_start
        )
        return (*told, *undefined)

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps; distances that are infinite become None."""
        return {
            "kind": self.kind.value,
            "sentence": self.sentence,
            "x_star": self.x_star.tolist(),
            "curvature": self.curvature.tolist(),
            "convex_within": [each if math.isfinite(each) else None for each in self.convex_within.tolist()],
            "kinks": list(self.kinks),
            "monotonicity": self.monotonicity,
            "is_affine": self.is_affine,
            "others": [each.tolist() for each in self.others],
            "undefined_at_start": list(self.undefined_at_start),
            "warnings": list(self.warnings),
        }


def judge_equilibrium(game: GameSource) -> Equilibrium | None:
    """Judge the equilibrium of a game: a file, an FMU's own file, a game of the package by its name.

    None if some players are elsewhere: nothing is known of their costs.

    Raises GameError if the game is none, has no equilibrium or an FMU holds none, BuildError if the
    installation lacks the host tool.
    """
    source = source_of(game)
    expect_file(source, "file", GameError)
    with file_of(source) as file:
        told = ask("--judge", file)
    return None if told is None else _equilibrium(told)


def has_affine_gradients(game: GameSource, expressions: Expressions) -> bool:
    """Whether the own gradients of a game with such expressions are affine: its unperturbed loop is linear.

    Raises as judge_equilibrium does.
    """
    if not has_expressions(expressions, "cost"):
        return True
    found = judge_equilibrium(game)
    return found is not None and found.is_affine


def _equilibrium(told: Mapping[str, Any]) -> Equilibrium:
    return Equilibrium(
        kind=Kind(told["kind"]),
        x_star=np.array(told["x_star"]),
        curvature=np.array(told["curvature"]),
        convex_within=np.array([math.inf if each is None else each for each in told["convex_within"]]),
        kinks=tuple(told["kinks"]),
        monotonicity=told["monotonicity"],
        is_affine=told["is_affine"],
        others=tuple(np.array(each) for each in told["others"]),
        undefined_at_start=tuple(told["undefined_at_start"]),
    )


def _shown(x: FloatArray) -> str:
    entries = [f"{each:.4g}" for each in x.ravel()[:LISTED]]
    return f"({', '.join(entries)}{', ...' if x.size > LISTED else ''})"
