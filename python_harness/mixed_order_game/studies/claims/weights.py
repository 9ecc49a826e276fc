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
    columns = [run.W_norm2.max(axis=(0, 2)) for run in runs]  # (N,) each
    largest = float(np.max(columns)) if columns else float("nan")
    W_max = game.of_players("W_max")
    worst = int(np.argmax(np.max(columns, axis=0) / W_max)) if columns else 0
    within = bool(columns) and float(np.max(columns, axis=0)[worst]) <= W_max[worst] * (1.0 + EXCESS)
    verdict = Verdict.HOLDS if within else Verdict.FAILS
    reason = f"The largest w'w of a column is {largest:.6g}, W_max is {W_max[worst]:.6g}."
    if columns and not isinstance(game.W_max, float):
        nearest = float(np.max(columns, axis=0)[worst])
        told = f"Nearest to its bound, w'w of player {worst + 1} reaches {nearest:.6g}"
        reason = f"{told}, W_max is {W_max[worst]:.6g}."
    if np.isnan(largest):
        verdict, reason = Verdict.NOT_SETTLED, "No robust run came to its end."
    return Claim(
        "lemma_3_weights",
        "Lemma 3: weights stay bounded, w'w <= W_max",
        verdict,
        reason,
        {"largest": largest},
    )
