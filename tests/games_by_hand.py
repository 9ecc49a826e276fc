"""The example games that have expressions, typed by hand from the formulas of their sources.

No expression is read. In costs x[..., i, j, l] is x_jl as player i sees it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.special import erf, ndtri

from tests.oracle.general_loop import Functions, own
from tests.oracle.paper_equations import Numbers

GAMES = Path(__file__).resolve().parents[1] / "modelDescription" / "games"


def column(*entries: Numbers | float) -> Numbers:
    """One entry for each player of a game with D = 1."""
    return np.array(entries)[:, np.newaxis]


def cournot_isoelastic() -> Functions:
    c, b = np.array([10.0, 8.0, 6.0, 4.0, 2.0]), np.array([1.2, 1.1, 1.0, 0.9, 0.8])

    def costs(x: Numbers) -> Numbers:
        quantity, total = 10.0 * own(x)[..., 0], 10.0 * x[..., 0].sum(axis=-1)
        price = 5000.0 ** (1.0 / 1.1) * total ** (-1.0 / 1.1)
        production = c * quantity + b / (1.0 + b) * 5.0 ** (-1.0 / b) * quantity ** ((1.0 + b) / b)
        return np.asarray(production - quantity * price)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        x1, x2, x3, x4, x5 = x[:, 0]
        return column(
            0.2 * np.sin(x1) * x2,
            0.1 * x2 - 0.3 * np.tanh(v[1, 0]),
            0.5 * np.log(1.0 + x3**2),
            0.4 * np.cos(x3 - x4),
            -0.2 * x5 + 0.1 * x1,
        )

    def disturbances(t: float) -> Numbers:
        return column(
            np.sin(t),
            1.2 * np.sin(0.7 * t + np.sin(0.4 * t)),
            0.8 * np.sin(1.7 * t) + 0.4,
            np.sin(1.3 * t),
            1.5 * np.exp(-0.1 * t) * np.cos(2.0 * t),
        )

    return Functions(costs, dynamics, disturbances)


def electric_vehicles(
    wanted: Sequence[float] = (9.0, 6.0, 12.0, 7.5, 10.5, 6.0),
    base: Sequence[float] = (14.0, 8.0, 11.0),
    capacity: float = 40.0,
) -> Functions:
    energy, load = np.array(wanted), np.array(base)

    def costs(x: Numbers) -> Numbers:
        charge = own(x)
        price = 15.0 * ((load + x.sum(axis=-2)) / capacity) ** 1.5
        even = np.sum((charge - energy[:, np.newaxis] / 3.0) ** 2, axis=-1)
        short = (charge.sum(axis=-1) - energy) ** 2
        return np.asarray(np.sum(price * charge, axis=-1) + 0.2 * even + short)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        g = 0.1 * x * np.tanh(x)
        g[3] = -0.2 * v[3] * np.sqrt(0.01 + v[3] ** 2) + 0.1 * x[0]
        return g

    def disturbances(t: float) -> Numbers:
        i, hour = np.arange(1, len(energy) + 1)[:, np.newaxis], np.arange(1, 4)
        return 1.5 * np.sin((0.5 + 0.2 * i) * t + hour)

    return Functions(costs, dynamics, disturbances)


def power_control() -> Functions:
    h, price = np.array([1.0, 0.8, 0.6, 0.9]), np.array([1.0, 0.8, 0.6, 0.9])
    utility = np.array([2.5, 2.0, 1.6, 2.2])

    def costs(x: Numbers) -> Numbers:
        received, power = x[..., 0] * h, own(x)[..., 0]
        interference = received.sum(axis=-1) - power * h
        ratio = 8.0 * h * power / (0.5 + interference)
        return np.asarray(price * power - utility * np.log(1.0 + ratio))

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        x1, x2, x3, x4 = x[:, 0]
        return column(
            0.3 * np.sin(2.0 * x1),
            -0.2 * v[1, 0] + 0.1 * x1 * x2,
            0.2 * x3 - 0.1 * x4,
            0.2 * np.arctan(x3 * x4),
        )

    def disturbances(t: float) -> Numbers:
        return column(
            1.5 * np.sin(2.0 * t),
            1.2 * np.sin(1.1 * t + 0.5),
            0.4 * np.sin(3.0 * t) + 0.2 * np.cos(np.sqrt(2.0) * t),
            np.sin(0.7 * t) + 0.2,
        )

    return Functions(costs, dynamics, disturbances)


def rate_allocation() -> Functions:
    capacity, w = np.array([10.0, 8.0, 12.0]), np.array([3.0, 2.0, 4.0, 2.5, 3.5, 3.0])
    routes = [[0], [0, 1], [1, 2], [2], [0, 2], [1, 2]]
    uses = np.array([[link in route for route in routes] for link in range(3)], dtype=float)

    def costs(x: Numbers) -> Numbers:
        load = x[..., 0] @ uses.T  # as player i sees it, of each link
        delay = 1.0 / (capacity - load)
        return np.asarray(np.sum(3.0 * uses.T * delay, axis=-1) - w * np.log(1.0 + own(x)[..., 0]))

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        x1, x2, x3, x4, x5, x6 = x[:, 0]
        return column(
            0.1 * x1,
            0.2 * np.sin(x1 * x2),
            0.1 * x3**2 / (1.0 + x6**2),
            -0.3 * v[3, 0] * np.tanh(v[3, 0] / 0.1),
            0.1 * x4 - 0.2 * x5,
            0.2 * np.exp(-x6) * x5,
        )

    def disturbances(t: float) -> Numbers:
        return 2.0 * np.sin((0.6 + 0.3 * np.arange(1, 7)[:, np.newaxis]) * t)

    return Functions(costs, dynamics, disturbances)


def energy_peak_price() -> Functions:
    h, w = np.array([5.0, 5.5, 6.0, 6.5, 7.0]), np.array([1.0, 1.2, 0.8, 1.0, 1.1])

    def costs(x: Numbers) -> Numbers:
        load, total = own(x)[..., 0], x[..., 0].sum(axis=-1)
        return np.asarray(w * (load - h) ** 2 + (1.0 + 4.0 * (total / 20.0) ** 3) * load)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        x1, x2, x3, x4, x5 = x[:, 0]
        return column(
            0.1 * x1,
            0.3 * erf(x1 - x2),
            0.1 * np.sqrt(1.0 + x3**2),
            -0.2 * np.sinh(0.2 * v[3, 0]),
            0.2 * x4 * np.cos(x5),
        )

    def disturbances(t: float) -> Numbers:
        return column(
            np.sin(t),
            1.2 * np.sin(0.8 * t + 0.5),
            0.8 * np.sin(1.6 * t) + 0.5,
            1.5 * np.sin(0.5 * t),
            np.sin(2.0 * t + 1.0),
        )

    return Functions(costs, dynamics, disturbances)


def source_seeking(
    sources: Sequence[Sequence[float]] = ((0.0, 2.0), (1.9, 0.6), (1.2, -1.6), (-1.2, -1.6), (-1.9, 0.6)),
) -> Functions:
    s = np.array(sources)
    N = len(s)
    players = np.arange(N)

    def costs(x: Numbers) -> Numbers:
        here = own(x)
        field = 8.0 * np.exp(-np.sum((here - s) ** 2, axis=-1) / (2.0 * 2.5**2))
        before, behind = x[..., players, (players + 1) % N, :], x[..., players, (players - 1) % N, :]
        distances = np.sum((here - before) ** 2 + (here - behind) ** 2, axis=-1)
        return np.asarray(0.12 * distances - field)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        del v
        turning = 0.3 * np.sin(x[:, :1]) * np.cos(x[:, 1:])
        return np.asarray(turning + 0.1 * np.roll(x, -1, axis=0))

    def disturbances(t: float) -> Numbers:
        i = np.arange(1, N + 1)[:, np.newaxis]
        return np.cos((0.7 + 0.2 * i) * t + 1.5 * np.array([1, 2]))

    return Functions(costs, dynamics, disturbances)


def rivalling_pairs() -> Functions:
    p = np.array([(1.0, -0.5), (-1.5, 1.0), (0.5, 2.0), (-1.0, -1.5)])
    S = np.zeros((4, 4))
    for i, j, gain in ((1, 2, 2.0), (1, 3, -1.5), (2, 4, 1.8), (3, 4, -2.2), (1, 4, 0.6)):
        S[i - 1, j - 1], S[j - 1, i - 1] = gain, -gain

    def costs(x: Numbers) -> Numbers:
        here = own(x)
        alone = np.sum(1.5 * np.cosh((here - p) / 2.0) + 0.4 * (here - p) ** 2, axis=-1)
        return np.asarray(alone + np.sum(S * np.sum(here[..., np.newaxis, :] * x, axis=-1), axis=-1))

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        g = 0.3 * np.sin(x) * np.roll(x, -1, axis=0)
        g[3] = -0.5 * v[3] - 0.2 * np.hypot(x[3, 0], x[3, 1])
        return np.asarray(g)

    def disturbances(t: float) -> Numbers:
        i = np.arange(1, 5)[:, np.newaxis]
        return np.sin((0.6 + 0.3 * i) * t) + 0.5 * np.cos(np.array([1, 2]) * t)

    return Functions(costs, dynamics, disturbances)


def underwater_vehicles(
    places: Sequence[Sequence[float]] = (
        (2.0, 1.0, -1.0),
        (-2.0, 1.5, -2.0),
        (-1.0, -2.0, -3.0),
        (1.5, -1.5, 0.0),
    ),
) -> Functions:
    p = np.array(places)

    def costs(x: Numbers) -> Numbers:
        here, middle = own(x), x.mean(axis=-2)
        near = np.sum((here - p) ** 2 + 1.5 * (here - middle) ** 2, axis=-1)
        return np.asarray(near + 0.05 * (here[..., 2] - p[:, 2]) ** 4)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        currents = (
            0.5 * np.sin(x[:, 1]),
            0.2 * x[:, 0] * x[:, 2],
            0.4 * np.sin(x[:, 2]) * np.roll(x[:, 0], -1),
        )
        speed = np.sqrt(np.sum(v**2, axis=1, keepdims=True) + 0.05**2)
        g = np.stack(currents, axis=1) - 0.4 * v * speed
        g[3] = 0.3 * np.sin(x[3]) + 0.1 * x[0]
        return np.asarray(g)

    def disturbances(t: float) -> Numbers:
        i, coordinate = np.arange(1, len(p) + 1)[:, np.newaxis], np.arange(1, 4)
        return np.asarray((1.0 + 0.2 * i) * np.sin((0.5 + 0.2 * coordinate) * t + i))

    return Functions(costs, dynamics, disturbances)


def normal(seed: int, k: int) -> float:
    """Number k of the sequence behind noise(seed, hold): NumPy advances the counter before the first word."""
    word = int(np.random.Philox(counter=(k - 1) % 2**256, key=seed).random_raw(1)[0])
    return float(ndtri(((word >> 12) + 0.5) / 2.0**52))


def switching_cooling() -> Functions:
    h, s = np.array([5.0, 5.5, 6.0, 6.5, 7.0]), np.array([1.2, 1.4, 1.6, 1.8, 2.0])

    def costs(x: Numbers) -> Numbers:
        load = own(x)[..., 0]
        return np.asarray((load - h) ** 2 + (0.4 * x[..., 0].sum(axis=-1) + 5.0) * load)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        g = 0.2 * x * np.cos(x)
        g[2] = 0.2 * x[2] - 0.4 * v[2]
        g[3] = 0.3 * np.sin(x[1]) - 0.4 * v[3]
        return np.asarray(g)

    def disturbances(t: float) -> Numbers:
        halves = [np.floor((t + 0.3 * i) / ((2.0 + 0.5 * i) / 2.0)) for i in range(1, 6)]
        square = np.array([1.0 if half % 2 == 0 else -1.0 for half in halves])
        noise = np.array([normal(i, int(np.floor(t / 0.4))) for i in range(1, 6)])
        return np.asarray(s * square + 0.4 * noise)[:, np.newaxis]

    switches = [k * (1.0 + 0.25 * i) - 0.3 * i for i in range(1, 6) for k in range(1, 4)]
    return Functions(costs, dynamics, disturbances, (*switches, 0.4, 0.8, 1.2))


def two_hundred_households(players: int = 200) -> Functions:
    """Wishes and weights are numbers that were drawn: those of the file, or its first ones."""
    given = tomllib.loads((GAMES / "two_hundred_households.toml").read_text(encoding="utf-8"))["parameters"]
    h, w = np.array(given["h"]["value"][:players]), np.array(given["w"]["value"][:players])
    i = np.arange(1, players + 1)[:, np.newaxis]

    def costs(x: Numbers) -> Numbers:
        load = own(x)[..., 0]
        return np.asarray(w * (load - h) ** 2 + 0.5 * np.exp(x[..., 0].mean(axis=-1) / 2.0) * load)

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        del v
        return np.asarray(0.1 * np.sin(np.roll(x, -1, axis=0)))

    def disturbances(t: float) -> Numbers:
        return np.asarray(2.0 * np.sin((0.5 + 0.01 * i) * t + i))

    return Functions(costs, dynamics, disturbances)


def fewer_households(players: int) -> str:
    """The game file with its first players alone, who also talk to the next one in the list."""
    text = (GAMES / "two_hundred_households.toml").read_text(encoding="utf-8")
    ring = [[i, i % players + 1] for i in range(1, players + 1)]

    def first_ones(found: re.Match[str]) -> str:
        name = found[1]
        values = tomllib.loads(found[0])[name]
        if name == "edges":
            values = ring + [edge for edge in values if max(edge) <= players and edge not in ring]
        elif name == "player":
            line = '{{ name = "{name}", order = {order}, x0 = {x0} }}'
            values = [line.format_map(player) for player in values[:players]]
        else:
            values = values[:players]
        return f"{name} = [{', '.join(str(value) for value in values)}]"

    return re.sub(r"^(player|edges|value) = \[\n.*?^\]$", first_ones, text, flags=re.MULTILINE | re.DOTALL)


BY_HAND: dict[str, Callable[[], Functions]] = {
    game.__name__: game
    for game in (
        cournot_isoelastic,
        electric_vehicles,
        power_control,
        rate_allocation,
        energy_peak_price,
        source_seeking,
        rivalling_pairs,
        underwater_vehicles,
        switching_cooling,
        two_hundred_households,
    )
}
