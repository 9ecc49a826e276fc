"""Random games whose dynamics and disturbances jump and bend, as texts and as Python functions made together.

`python -m tests.switching_games GAMES` compares many with SciPy, which locates the jumps, and prints what it
saw.

What jumps is a function of the action of another player, whose rate stays continuous: nothing slides.
"""

from __future__ import annotations

import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tests.oracle.general_loop import FloatArray, Functions, GeneralLoop, own
from tests.oracle.paper_equations import Numbers

# of the next player's action X: the text, the thresholds at which it jumps or bends, and its value at X where
# as many of them as `below` are passed
JUMPS: dict[str, tuple[str, list[float], Callable[[Numbers, Numbers], Numbers]]] = {
    "if": ("if(X > 0.2, 1.0, -0.5)", [0.2], lambda _, below: np.where(below > 0, 1.0, -0.5)),
    "and": (
        "if(X > -0.3 and not X > 0.25, 1.0, 0.0)",
        [-0.3, 0.25],
        lambda _, below: np.where(below == 1, 1.0, 0.0),
    ),
    "or": (
        "if(X < -0.2 or X >= 0.3, X, 0.5)",
        [-0.2, 0.3],
        lambda x, below: np.where(below == 1, 0.5, x),
    ),
    "sign": ("sign(X - 0.15)", [0.15], lambda _, below: 2.0 * (below > 0) - 1.0),
    "floor": ("floor(2.0 * X)", [0.5 * k for k in range(-20, 21)], lambda _, below: below - 21.0),
    "mod": ("mod(X, 0.4)", [0.4 * k for k in range(-20, 21)], lambda x, below: x - 0.4 * (below - 21.0)),
    "abs": ("abs(X - 0.1)", [0.1], lambda x, _: np.abs(x - 0.1)),
    "min and max": ("min(max(X, -0.2), 0.3)", [-0.2, 0.3], lambda x, _: np.clip(x, -0.2, 0.3)),
}
SIGNALS: dict[str, tuple[str, Callable[[float], float], Callable[[float], list[float]]]] = {
    "square": (
        "square(t, 0.9)",
        lambda t: 1.0 if np.floor(t / 0.45) % 2 == 0 else -1.0,
        lambda end: [0.45 * k for k in range(1, int(end / 0.45) + 1)],
    ),
    "pulse": (
        "pulse(t, 0.37, 0.01)",
        lambda t: 1.0 if 0.37 <= t < 0.37 + 0.01 else 0.0,
        lambda _: [0.37, 0.37 + 0.01],
    ),
    "condition": (
        "if(sin(3.0 * t) > 0.4, 1.0, 0.0)",
        lambda t: 1.0 if np.sin(3.0 * t) > 0.4 else 0.0,
        lambda end: [
            when
            for k in range(int(end) + 1)
            for when in (
                (np.arcsin(0.4) + 2.0 * np.pi * k) / 3.0,
                (np.pi - np.arcsin(0.4) + 2.0 * np.pi * k) / 3.0,
            )
            if when < end
        ],
    ),
}
STOP = 1.5  # s
COST = "w[i] * sum((x[i,k] - h[i,k])^2 for k in 1..D) + 0.2 * x[i,1] * tanh(x[mod(i, N) + 1,1])"


@dataclass(frozen=True)
class SwitchingGame:
    text: str
    names: tuple[str, str]  # in JUMPS and SIGNALS
    loop: SwitchingLoop


class SwitchingLoop(GeneralLoop):
    """A loop whose dynamics jump where actions pass thresholds; `below` counts those that each has passed."""

    def __init__(self, tables: dict[str, Any], functions: Functions, thresholds: list[float]) -> None:
        super().__init__(tables, functions)
        self.thresholds = np.array([-np.inf, *thresholds, np.inf])
        self.below = np.searchsorted(self.thresholds, self.x0, side="right") - 1
        self.events = 0

    def _crossing(self, entry: tuple[int, int], rising: bool) -> Callable[[float, FloatArray], float]:
        threshold = self.thresholds[self.below[entry] + (1 if rising else 0)]

        def distance(_: float, state: FloatArray) -> float:
            if not np.isfinite(threshold):
                return 1.0
            # a state at which it has just risen must not count as one at which it falls
            return float(self.unpack(state)[0][entry] - threshold) + (0.0 if rising else 1e-12)

        distance.terminal = True  # type: ignore[attr-defined]
        distance.direction = 1.0 if rising else -1.0  # type: ignore[attr-defined]
        return distance

    def solve(self, times: FloatArray, rtol: float = 1e-9, atol: float = 1e-10) -> FloatArray:
        """States (T, n) at times (T,) from 0 on; jumps are located, and counted in `events`."""
        start, state = 0.0, self.initial_state()
        rows = [state[np.newaxis]]
        ends = [when for when in self.functions.jumps if when < times[-1]] + [float(times[-1])]
        crossings = [(entry, rising) for entry in np.ndindex(self.N, self.D) for rising in (False, True)]
        for end in ends:
            while start < end:
                found = solve_ivp(
                    self._rate_until(float(np.nextafter(end, start))),
                    (start, end),
                    state,
                    "DOP853",
                    rtol=rtol,
                    atol=atol,
                    dense_output=True,
                    events=[self._crossing(*each) for each in crossings],
                )
                if not found.success:
                    raise ArithmeticError(found.message)
                assert found.sol is not None
                assert found.t_events is not None
                here = float(found.t[-1])
                within = times[(times > start) & (times <= here)]
                if len(within):
                    rows.append(found.sol(within).T)
                start, state = here, found.y[:, -1]
                if found.status == 1:
                    for (entry, rising), when in zip(crossings, found.t_events, strict=True):
                        if len(when):
                            self.below[entry] += 1 if rising else -1
                            self.events += 1
            if end < times[-1]:
                self.events += self.N  # each player has a signal of its own
        return np.concatenate(rows)


def switching_game(seed: int, players: int, dimension: int) -> SwitchingGame:
    """Deterministic in its arguments; jumps and signals come in their turn."""
    random = np.random.default_rng([seed, 78])
    jump, signal = list(JUMPS)[seed % len(JUMPS)], list(SIGNALS)[seed % len(SIGNALS)]
    (text, thresholds, value), (of_time, at_time, jumps) = JUMPS[jump], SIGNALS[signal]
    h = np.round(random.uniform(-1.5, 1.5, (players, dimension)), 3)
    w = np.round(random.uniform(1.0, 2.0, players), 3)
    x0 = np.round(random.uniform(-1.5, 1.5, (players, dimension)), 3)
    a, b = round(float(random.uniform(0.3, 1.0)), 3), round(float(random.uniform(0.3, 1.0)), 3)
    order = [1 + (k + seed) % 2 for k in range(players)]
    i, coordinate = np.arange(1, players + 1)[:, np.newaxis], np.arange(1, dimension + 1)

    def costs(x: Numbers) -> Numbers:
        here, following = own(x), x[..., np.arange(players), np.arange(1, players + 1) % players, 0]
        return np.asarray(w * np.sum((here - h) ** 2, axis=-1) + 0.2 * here[..., 0] * np.tanh(following))

    def dynamics(x: Numbers, v: Numbers) -> Numbers:
        del v
        jumping = value(np.roll(x, -1, axis=0), np.roll(loop.below, -1, axis=0))
        return np.asarray(0.3 * np.sin(x) + a * jumping)

    def disturbances(t: float) -> Numbers:
        return np.asarray(0.8 * np.sin(1.7 * t + i + coordinate) + b * at_time(t))

    jumping_text = text.replace("X", "x[mod(i, N) + 1,l]")
    lines = [
        f'title = "Switching game {seed}"',
        f"dimension = {dimension}",
        "[gains]",
        *[f"{name} = {gain}" for name, gain in {"k1": 6.0, "k2": 0.8, "k3": 8.0, "k4": 7.0}.items()],
        "beta = 3.0",
        "delta = 1.2",
        "epsilon = 0.1",
        "[rbf]",
        "centers = [-1.0, 0.0, 1.0]",
        f"width = {round(1.5 * (players * dimension) ** 0.5, 3)}",
        "W_max = 500.0",
        "[graph]",
        f"edges = {[[k, k % players + 1] for k in range(1, players + (players > 2))]}",
        "[parameters]",
        f"h = {h.tolist()}",
        f"w = {w.tolist()}",
        "[defaults]",
        'z0 = "x0"',
        'y0 = "x0"',
        f'cost = {{ expression = "{COST}" }}',
        f'dynamics = {{ expression = "0.3 * sin(x[i,l]) + {a} * {jumping_text}" }}',
        f'disturbance = {{ expression = "0.8 * sin(1.7 * t + i + l) + {b} * {of_time}" }}',
    ]
    for k in range(players):
        lines += ["[[player]]", f'name = "{k + 1}"', f"order = {order[k]}", f"x0 = {x0[k].tolist()}"]
    game = "\n".join(lines) + "\n"
    functions = Functions(costs, dynamics, disturbances, sorted(jumps(STOP)))
    loop = SwitchingLoop(tomllib.loads(game), functions, thresholds)
    return SwitchingGame(game, (jump, signal), loop)


@dataclass(frozen=True)
class Seen:
    difference: float  # of x, largest
    events: tuple[int, int]  # found, expected


def compare(made: SwitchingGame, folder: Path) -> Seen:
    """The FMU at rtol 1e-8 against SciPy."""
    import mixed_order_game as mog
    from mixed_order_game.fmu.build import build_fmu

    game = folder / "game.toml"
    game.write_text(made.text, encoding="utf-8")
    fmu = build_fmu(game, folder / "game.fmu")
    found = mog.run(fmu, stop_time=STOP, step=STOP / 15.0, tolerance=1e-8, outputs=["x", "solver_events"])
    x = made.loop.unpack(made.loop.solve(found.time))[0]
    events = int(found.columns["solver_events"][-1])
    return Seen(float(np.abs(found.x - x).max()), (events, made.loop.events))


def main() -> None:
    """Compare as many games as the argument says."""
    worst, unequal, events = 0.0, 0, 0
    for seed in range(int(sys.argv[1])):
        with tempfile.TemporaryDirectory() as folder:
            seen = compare(switching_game(seed, 2 + seed % 7, 1 + seed % 3), Path(folder))
        worst, unequal = max(worst, seen.difference), unequal + (seen.events[0] != seen.events[1])
        events += seen.events[1]
        print(seed, seen, flush=True)
    print(f"largest difference {worst:.1e}, {events} events, counts differ in {unequal} games")


if __name__ == "__main__":
    main()
