"""Lemma 3's claim: no weight column leaves the ball w'w <= W_max."""

from collections.abc import Iterable

import numpy as np

from ...game.parameters import GameParameters
from ...results.result import Result
from .verdict import Claim, Verdict

EXCESS = 1e-9
"""Relative rounding granted to the bound."""


def weights_bounded(runs: Iterable[Result], game: GameParameters) -> Claim:
    """Judged on every sample of every robust run."""
    largest = max((float(np.max(run.W_norm2)) for run in runs), default=float("nan"))
    within = largest <= game.W_max * (1.0 + EXCESS)
    verdict = Verdict.HOLDS if within else Verdict.FAILS
    reason = f"The largest w'w of a column is {largest:.6g}, W_max is {game.W_max:.6g}."
    if np.isnan(largest):
        verdict, reason = Verdict.NOT_SETTLED, "No robust run came to its end."
    return Claim(
        "lemma_3_weights",
        "Lemma 3: weights stay bounded, w'w <= W_max",
        verdict,
        reason,
        {"largest": largest},
    )
