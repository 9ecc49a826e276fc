"""Example games with more players: text and functions by hand from one source of numbers.

Costs, dynamics and disturbances are those of the example, whose formulas hold for any N. The network's width
grows with sqrt(N), as the distances between estimates do.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import cos, pi, sin

from tests.games_by_hand import GAMES, electric_vehicles, source_seeking, underwater_vehicles
from tests.oracle.general_loop import Functions

from .scaling_game import CENTERS


def example_with(name: str, values: Mapping[str, object], players: Sequence[str] = ()) -> str:
    """An example's text with other values of keys that stand on one line, and other players if any."""
    text = (GAMES / f"{name}.toml").read_text(encoding="utf-8")
    if players:
        text = text[: text.index("[[player]]")] + "\n".join(
            f'[[player]]\nname = "{i}"\n{lines}\n' for i, lines in enumerate(players, start=1)
        )
    for key, value in values.items():
        line = rf"^((?:{key} = \{{ value|{key}) = )(\[.*\]|[0-9.]+)"
        text, count = re.subn(line, rf"\g<1>{value}", text, flags=re.MULTILINE)
        if count != 1:
            raise ValueError(f"{name}: {count} lines give {key}, expected one")
    return text


def with_eleven_neurons(name: str) -> str:
    """An example game with as many centres as the paper's; it has fewer."""
    return example_with(name, {"centers": CENTERS})


def ring_with_chords(players: int) -> list[list[int]]:
    """Edges from each player to the next one and the fourth after."""
    return [[i, (i + step - 1) % players + 1] for step in (1, 4) for i in range(1, players + 1)]


def seekers(players: int) -> tuple[str, Functions]:
    """source_seeking with its sources at equal distances on their circle, every second vehicle of order 2."""
    angles = [2.0 * pi * k / players for k in range(players)]
    sources = [[round(2.0 * sin(angle), 2), round(2.0 * cos(angle), 2)] for angle in angles]
    starts = [[round(1.5 * s[0] + 0.5, 2), round(1.5 * s[1] - 0.5, 2)] for s in sources]
    lines = [
        f"order = {1 + k % 2}\nx0 = {start}\n[player.cost]\n"
        f"coupling = [[{(k + 1) % players + 1}, 0.12], [{(k - 1) % players + 1}, 0.12]]\n"
        'expression = "-A * exp(-((x[i,1] - s[i,1])^2 + (x[i,2] - s[i,2])^2) / (2 * r^2))"'
        for k, start in enumerate(starts)
    ]
    values = {
        "centers": CENTERS,
        "width": 6.0 * (players / 5.0) ** 0.5,
        "edges": ring_with_chords(players),
        "value": sources,
    }
    return example_with("source_seeking", values, lines), source_seeking(sources)


def cars(players: int) -> tuple[str, Functions]:
    """electric_vehicles with other loads and the capacity in proportion, every second vehicle with a ramp."""
    share = players / 6.0
    wanted = [6.0 + 1.5 * (3 * k % 5) for k in range(players)]
    base, capacity = [14.0 * share, 8.0 * share, 11.0 * share], 40.0 * share
    starts = [[0.5 + (k + 2 * h) % 4 for h in range(3)] for k in range(players)]
    lines = [f"order = {1 + k % 2}\nx0 = {start}" for k, start in enumerate(starts)]
    lines[3] += '\ndynamics = { expression = "-0.2 * v[i,l] * sqrt(0.01 + v[i,l]^2) + 0.1 * x[1,l]" }'
    values = {
        "width": 6.0 * share**0.5,
        "edges": ring_with_chords(players),
        "base": base,
        "capacity": capacity,
        "energy": wanted,
    }
    return example_with("electric_vehicles", values, lines), electric_vehicles(wanted, base, capacity)


def divers(players: int) -> tuple[str, Functions]:
    """underwater_vehicles with places to survey on a circle at different depths; vehicle 4 stays the buoy."""
    angles = [2.0 * pi * k / players for k in range(players)]
    around = [(round(2.5 * cos(angle), 2), round(2.5 * sin(angle), 2)) for angle in angles]
    places = [[*place, -float(k % 4)] for k, place in enumerate(around)]
    lines = [f"x0 = [{round(-p[1], 2)}, {p[0]}, {round(-0.2 * k, 2)}]" for k, p in enumerate(places)]
    lines[3] += '\norder = 1\ndynamics = { expression = "0.3 * sin(x[i,l]) + 0.1 * x[1,l]" }'
    values = {
        "centers": CENTERS,
        "width": 8.0 * (players / 4.0) ** 0.5,
        "edges": ring_with_chords(players),
        "value": places,
    }
    return example_with("underwater_vehicles", values, lines), underwater_vehicles(places)
