"""Games of the suite whose costs, dynamics and disturbances are written wholly as expressions.

`python -m tests.bench.expression_games {five,scaling,aggregative} [PLAYERS] > game.toml`.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from .scaling_game import scaling_game

PAPER_GAME = Path(__file__).resolve().parents[2] / "modelDescription" / "games" / "five_vehicles.toml"

DYNAMICS = ('"x[2,l]"', '["x[2,1]^2 + x[3,1]", "x[2,2]"]', '"3 * x[3,l]"', '"4 * x[4,l]"', '"5 * x[5,l]"')
# The last terms of a text come first in its gradients, which so are summed as those of the coefficients are:
# the same bits.
FIVE_COST = (
    "i + sum(i * x[i,k] for k in 1..D)"
    " + sum(C[i,N - h] * sum((x[i,k] - x[N - h,k])^2 for k in 1..D) for h in 0..N - 1)"
    " + sum(i * x[i,k]^2 for k in 1..D)"
)
SCALING_COST = (
    "(1 + mod(i - 1, 5)) * (x[i,1]^2 + x[i,2]^2 + x[i,1] - x[i,2])"
    " + sum((x[i,k] - x[mod(i, N) + 1,k])^2 + 0.5 * (x[i,k] - x[mod(i + 6, N) + 1,k])^2 for k in 1..D)"
)


def five_vehicles(cost: str = FIVE_COST) -> str:
    """The paper's example; its couplings are a fixed matrix C."""
    text = PAPER_GAME.read_text(encoding="utf-8")
    coupling = [[0.0] * 5 for _ in range(5)]
    for i, j in ((1, 2), (2, 3), (3, 2), (4, 2), (4, 5), (5, 1)):
        coupling[i - 1][j - 1] = 1.0
    text = re.sub(r"^cost = .*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"^disturbance = .*\n", "", text, flags=re.MULTILINE)
    texts = iter(DYNAMICS)

    text = re.sub(
        r"^dynamics = .*$",
        lambda _: f"dynamics = {{ expression = {next(texts)} }}",
        text,
        flags=re.MULTILINE,
    )
    tables = (
        f"[parameters]\nC = {{ value = {coupling}, fixed = true }}\n\n"
        f'[defaults]\ncost = {{ expression = "{cost}" }}\n'
        'disturbance = { expression = "i * sin(i * t)" }\n'
    )
    return text.replace("[[player]]", tables + "\n[[player]]", 1)


def scaling_by_defaults(players: int) -> str:
    """The scaling family with one cost, one dynamics and one disturbance for all players."""
    text = scaling_game(players)
    text = re.sub(r"^(cost|dynamics|disturbance) = .*\n", "", text, flags=re.MULTILINE)
    tables = (
        f'[defaults]\ncost = {{ expression = "{SCALING_COST}" }}\n'
        'dynamics = { expression = "0.5 * x[mod(i, N) + 1,l]" }\n'
        'disturbance = { expression = "(1 + mod(i - 1, 3)) * sin((1 + mod(i - 1, 4)) * t + l)" }\n'
    )
    return text.replace("[[player]]", tables + "\n[[player]]", 1)


def scaling_in_one_coordinate(players: int) -> str:
    """The scaling family with D = 1."""
    text = scaling_game(players).replace("dimension = 2", "dimension = 1")
    text = re.sub(r"^x0 = \[([^,]*),.*\]", r"x0 = \1", text, flags=re.MULTILINE)
    text = re.sub(r"linear = \[([^,\[]*),[^\]]*\]", r"linear = \1", text)
    text = text.replace("phase = [1.0, 2.0]", "phase = 1.0")
    return re.sub(r"^width = .*$", f"width = {(5.0 * players) ** 0.5!r}", text, flags=re.MULTILINE)


def aggregative(players: int) -> str:
    """Costs that depend on the mean of all actions, with as many states as the family in one coordinate."""
    text = scaling_by_defaults(players).replace("dimension = 2", "dimension = 1")
    text = re.sub(r"^x0 = \[([^,]*),.*\]", r"x0 = \1", text, flags=re.MULTILINE)
    cost = "(1 + mod(i - 1, 5)) * x[i]^2 + x[i] * tanh(sum(x[j] for j in 1..N) / N)"
    text = text.replace(SCALING_COST, cost)
    return re.sub(r"^width = .*$", f"width = {(5.0 * players) ** 0.5!r}", text, flags=re.MULTILINE)


def main() -> None:
    """Write one of the games to standard output."""
    players = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    text = {
        "five": five_vehicles(),
        "scaling": scaling_by_defaults(players),
        "aggregative": aggregative(players),
    }
    sys.stdout.write(text[sys.argv[1]])


if __name__ == "__main__":
    main()
