"""The scaling family of games, for any number of players, as a game definition file.

`python -m tests.bench.scaling_game 20 > twenty.toml`; half of the players are of order 2, the graph has
degree four or, with --complete, joins all players, and the consensus gain k3 grows with N so that the
unperturbed loop stays stable.
"""

from __future__ import annotations

import argparse
import math
import sys

CENTERS = [-2.5 + 0.5 * m for m in range(11)]


def scaling_game(players: int, complete: bool = False) -> str:
    """The TOML text of the game with N players; indices run from 1 and are cyclic modulo N.

    f_i = q_i |x_i|^2 + q_i (x_i1 - x_i2) + |x_i - x_(i+1)|^2 + 0.5 |x_i - x_(i+7)|^2, q_i = 1 + (i-1) mod 5,
    g_i = 0.5 x_(i+1), d_il = (1 + (i-1) mod 3) sin((1 + (i-1) mod 4) t + l), x_il(0) = 5 sin(i + l),
    edges (i, i+1) and (i, i + floor(N/3)), or all. Raises ValueError for fewer than two players.
    """
    if players < 2:
        raise ValueError(f"at least 2 players expected, not {players}")

    def cyclic(index: int) -> int:
        return (index - 1) % players + 1

    edges = sorted(
        {
            (min(i, j), max(i, j))
            for i in range(1, players + 1)
            for j in (range(1, players + 1) if complete else (cyclic(i + 1), cyclic(i + players // 3)))
            if i != j
        }
    )
    lines = [
        f'title = "Scaling family, {players} players"',
        "dimension = 2",
        "",
        "[gains]",
        "k1 = 10.0",
        "k2 = 1.0",
        f"k3 = {50.0 * max(1.0, players / 20.0)!r}",
        "k4 = 50.0",
        "beta = 100.0",
        "delta = 10.0",
        "epsilon = 0.01",
        "",
        "[rbf]",
        f"centers = {CENTERS}",
        f"width = {math.sqrt(10.0 * players)!r}",
        "W_max = 500.0",
        "",
        "[graph]",
        f"edges = {[list(edge) for edge in edges]}",
    ]
    for i in range(1, players + 1):
        q = 1 + (i - 1) % 5
        amplitude, frequency = 1.0 + (i - 1) % 3, 1.0 + (i - 1) % 4
        coupling: dict[int, float] = {}
        for j, c in ((cyclic(i + 1), 1.0), (cyclic(i + 7), 0.5)):
            if j != i:  # a player's distance to itself is zero
                coupling[j] = coupling.get(j, 0.0) + c
        start = [5.0 * math.sin(i + coordinate) for coordinate in (1, 2)]
        lines += [
            "",
            "[[player]]",
            f'name = "player {i}"',
            f"order = {1 if i <= players // 2 else 2}",
            f"x0 = {start}",
            f"cost = {{ quadratic = {q}.0, linear = [{q}.0, -{q}.0], "
            f"coupling = {[[j, c] for j, c in coupling.items()]} }}",
            f"dynamics = {{ linear = [[{cyclic(i + 1)}, 0.5]] }}",
            f"disturbance = {{ amplitude = {amplitude}, frequency = {frequency}, phase = [1.0, 2.0] }}",
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the game with the given number of players to standard output."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("players", type=int)
    parser.add_argument("--complete", action="store_true", help="join all players")
    arguments = parser.parse_args()
    sys.stdout.write(scaling_game(arguments.players, arguments.complete))


if __name__ == "__main__":
    main()
