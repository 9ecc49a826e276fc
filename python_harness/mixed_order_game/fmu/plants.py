"""Plants as Python functions, integrated together with the FMU whose players they are."""

from collections.abc import Callable, Mapping, Sequence
from ctypes import byref, c_void_p
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2True
from numpy.typing import ArrayLike, NDArray

from ..errors import ExperimentError, GameError, SimulationError
from ..game.definition import Table, initial_estimates, initial_references
from ..times import in_seconds
from .functions import ABSOLUTE, GROWTH, called, end_of_step, step_factor
from .model import Model
from .parts import EXTERNAL_STEP
from .reals import Reals

FloatArray = NDArray[np.float64]

Plant = Callable[[float, FloatArray, FloatArray, FloatArray], ArrayLike]
"""f(t, x, v, u) -> rate: the plant of one player. t in s; x, v and u are its own action, velocity and
control, (D,) each, v NaN for order 1; the rate (D,) is that of x for order 1, of v for order 2."""

Plants = Mapping[int, Plant]
"""Plants by 1-based player."""

FIRST_STEP, SHORTEST_STEP = 1e-4, 1e-7
"""Of the integration, in times between two communication points."""
ORDER = 3
"""Of the formula: higher ones damp oscillations less."""
RESIDUAL = 0.01
"""What may be left of an equation, in parts of the tolerance."""
MOST_FAILURES = 200
"""Of steps, in succession."""


def with_plants_outside(game: Table, numbers: Sequence[int]) -> dict[str, Any]:
    """The tables of a game, its defaults applied, in which the plants of some players, 1-based, are external.

    Raises GameError for a player whose control is bounded.
    """
    players = list(game["player"])
    for i, player in enumerate(game["player"]):
        own = dict(player)
        if own.get("y0") == "x0":
            own["y0"] = initial_estimates(game["player"], i, game["dimension"])
        if i + 1 in numbers and own.get("plant") != "external":
            if "u_max" in own:
                raise GameError(
                    f"player {i + 1} has u_max, which belongs to the plant that is replaced: leave it out "
                    "and bound u in the function"
                )
            if "z0" in own:
                own["z0"] = initial_references(own)
            own = {key: own[key] for key in own if key not in ("dynamics", "disturbance", "x0", "v0")}
            own["plant"] = "external"
        players[i] = own
    return {**game, "player": players}


def initial_states(game: Table, numbers: Sequence[int]) -> dict[str, float]:
    """x0 and v0 of the players that have them, as the start values of the inputs x and v."""
    found: dict[str, float] = {}
    for number in numbers:
        player = game["player"][number - 1]
        for stem, key in (("x", "x0"), ("v", "v0"))[: player["order"]]:
            values = np.broadcast_to(np.asarray(player.get(key, 0.0), dtype=np.float64), game["dimension"])
            found |= {f"{stem}[{number},{k}]": float(value) for k, value in enumerate(values, 1)}
    return found


class PlantFunctions:
    """The plants of n players with D coordinates each, and their states, in one run.

    A player's law is instantaneous in its own action (order 1) or velocity (order 2), here called p. If p and
    u met at communication points alone, the loop would be stable only for steps below 2 / (k + K delta^2 /
    epsilon), or half of that. So u follows p within each step: p' = f(t, x, v, u(p)) is solved by backward
    differentiation formulas up to order 3, with variable steps. What else the FMU holds, estimates,
    references and weights, first follows a predicted path of p; it is set back and follows the path that was
    found. The difference of both paths controls the step.
    """

    def __init__(self, model: Model, plants: Plants, tolerance: float) -> None:
        self._numbers = sorted(plants)
        self._functions = [plants[number] for number in self._numbers]
        orders = [model.order[number - 1] for number in self._numbers]
        self._second = np.array(orders) > 1
        self._tolerance = tolerance
        self._shape = (len(orders), model.dimension)

        def references(stem: str, number: int) -> list[int]:
            names = (f"{stem}[{number},{k}]" for k in range(1, model.dimension + 1))
            return [model.variable(name).reference for name in names]

        of_p: list[int] = []
        of_x: list[int] = []
        gains: list[int] = []
        for number, order in zip(self._numbers, orders, strict=True):
            of_p += references("x" if order == 1 else "v", number)
            of_x += references("x", number) if order > 1 else []
            for gain in ("k1" if order == 1 else "k4", "delta", "epsilon"):
                name = gain if gain in model.variables else f"{gain}[{number}]"
                gains.append(model.variable(name).reference)
        signals = [each for stem in ("u", "nn", "phi") for i in self._numbers for each in references(stem, i)]
        self._p_inputs, self._x_inputs = Reals(of_p), Reals(of_x)
        self._signals, self._gains = Reals([*signals, *of_p]), Reals(gains)
        self._robust = model.variable("robust").reference

    def begin(self, slave: Any, time: float) -> None:
        """Take the initial states from the FMU's inputs, when its initialization has ended."""
        self._slave = slave
        self._strict = float(slave.getBoolean([self._robust])[0])
        p = self._p_inputs.read(slave).reshape(self._shape)
        x = self._x_inputs.read(slave).reshape(-1, self._shape[1])
        self._past = [(time, p, x)]  # the last points, the newest first
        self._wanted = 0.0
        self._failures = 0
        self._read_law()
        self._rate = np.zeros(self._shape)
        for k, (number, action) in enumerate(zip(self._numbers, self._actions(p, x), strict=True)):
            self._rate[k] = self._asked(k, time, p[k], action, self._control(k, p[k]))
            if not np.all(np.isfinite(self._rate[k])):
                raise ExperimentError(
                    f"{_plant(number, time)} has the rate {self._rate[k].tolist()}, expected finite numbers"
                )

    def advance(self, begin: float, end: float) -> None:
        """Take the FMU and the plants from one communication point to the next."""
        slave, component, saved = self._slave, self._slave.component, c_void_p()
        shortest = max(SHORTEST_STEP * (end - begin), 16.0 * float(np.spacing(max(abs(begin), abs(end)))))
        wanted = self._wanted or FIRST_STEP * (end - begin)
        time = begin
        try:
            while time < end:
                if len(self._past) > 1:
                    wanted = min(wanted, GROWTH * (time - self._past[1][0]))
                after = end_of_step(time, max(wanted, shortest), end)
                h = after - time
                slave.fmi2GetFMUstate(component, byref(saved))
                error = self._attempt(time, after)
                slave.fmi2SetFMUstate(component, saved)
                proposed = h * step_factor(error, min(ORDER, len(self._past)))
                if error > 1.0:
                    wanted = proposed
                    self._failures += 1
                    if self._failures > 1:
                        del self._past[1:]  # of a smooth rate they would have told more
                    if h > 2.0 * shortest:
                        continue
                    self._require_sense(after, error)
                else:
                    # the interval's end may have cut the step short
                    wanted = proposed if h > 0.9 * wanted else max(wanted, proposed)
                    self._failures = 0
                self._accept(time, after)
                time = after
        finally:
            if saved.value is not None:
                slave.fmi2FreeFMUstate(component, byref(saved))
        self._wanted = wanted

    def _attempt(self, time: float, after: float) -> float:
        """Find p after a step, in which the FMU follows a prediction; its error in parts of the tolerance."""
        h, past = after - time, self._past[:ORDER]
        order, (_, p, _) = len(past), past[0]
        powers = np.arange(2, order + 1)
        # the polynomial of that degree through the past points that has the last one's rate
        back = np.array([t - time for t, _, _ in past[1:]]) / h
        rest = np.array([q - p - s * h * self._rate for s, (_, q, _) in zip(back, past[1:], strict=True)])
        bends = np.zeros((2, *self._shape))  # coefficients of (s / h)^2 and (s / h)^3
        if order > 1:
            bends[: order - 1] = np.tensordot(np.linalg.inv(back[:, None] ** powers), rest, 1)
        predicted = p + h * self._rate + bends.sum(axis=0)
        self._tell(
            bends[0] * 2.0 / h**2,
            bends[1] * 6.0 / h**3,
            self._rate[self._second],
            (bends[0] * 2.0 / h**2)[self._second],
        )
        self._slave.fmi2DoStep(self._slave.component, time, h, fmi2True)
        self._read_law()
        # the derivative, at the end, of the polynomial through the past points and the one sought
        nodes = np.array([0.0, *((t - after) / h for t, _, _ in past)])
        slope = np.linalg.solve(np.vander(nodes, increasing=True).T, np.eye(order + 1)[1])
        self._weight = h / slope[0]
        self._known_p, self._known_x = (
            -sum(weight * point[k] for weight, point in zip(slope[1:], past, strict=True)) / slope[0]
            for k in (1, 2)
        )
        bound = self._tolerance * (ABSOLUTE + np.maximum(np.abs(p), np.abs(predicted)))
        found = [self._solved(k, after, predicted[k], bound[k]) for k in range(len(self._numbers))]
        self._found = np.array(found)
        # of the difference, the formula's part is 1 / (1 + h slope)
        error = float(np.max(np.abs(self._found - predicted) / bound)) / (1.0 + slope[0])
        return error if np.isfinite(error) else np.inf

    def _solved(self, k: int, time: float, guess: FloatArray, bound: FloatArray) -> FloatArray:
        """p of one player after the step: p = known + weight f(t, x, v, u(p)); NaN where none is found."""
        from scipy.optimize import root  # which most runs do not need

        known, weight = self._known_p[k], self._weight
        position = self._actions(self._known_p, self._known_x)[k] if self._second[k] else None

        def residual(p: FloatArray) -> FloatArray:
            x = p if position is None else position + weight * p
            rate = self._asked(k, time, p, x, self._control(k, p))
            return np.asarray(p - known - weight * rate)

        with np.errstate(all="ignore"):
            found = root(residual, guess, method="hybr", options={"xtol": RESIDUAL * self._tolerance})
            good = bool(np.all(np.abs(found.fun) <= RESIDUAL * bound))
        return np.asarray(found.x if good else np.full_like(guess, np.nan), dtype=np.float64)

    def _require_sense(self, time: float, error: float) -> None:
        """Allow a shortest step in spite of its error, as across a jump, unless that leads nowhere."""
        if np.isfinite(error) and self._failures < MOST_FAILURES:
            return
        for number, found in zip(self._numbers, self._found, strict=True):
            if np.isfinite(error) or not np.all(np.isfinite(found)):
                raise SimulationError(
                    f"{_plant(number, time)}: no step is short enough for its rate, which is not finite or "
                    "jumps to and fro with x, v or u; tanh(s / width) is a smooth sign(s)"
                )

    def _accept(self, time: float, after: float) -> None:
        """Let the FMU follow the path that was found: p by values and rates at both ends, x by its end."""
        h, second, (_, p, x) = after - time, self._second, self._past[0]
        new_p, new_x = self._found, self._known_x + self._weight * self._found[self._second]
        rate = (new_p - self._known_p) / self._weight
        rise, p_rest = new_p - p, new_x - x - h * p[second] - 0.5 * h * h * self._rate[second]
        square, cube = 3.0 * rise - h * (2.0 * self._rate + rate), h * (self._rate + rate) - 2.0 * rise
        self._tell(square * 2.0 / h**2, cube * 6.0 / h**3, self._rate[second], p_rest * 6.0 / h**3)
        self._slave.fmi2DoStep(self._slave.component, time, h, fmi2True)
        self._rate = rate
        self._past = [(after, new_p, new_x), *self._past[: ORDER - 1]]

    def _tell(self, p2: FloatArray, p3: FloatArray, x2: FloatArray, x3: FloatArray) -> None:
        """Give the FMU p and x with their rates, second and third derivatives."""
        _, p, x = self._past[0]
        self._p_inputs.tell(self._slave, p, self._rate, p2, p3)
        self._x_inputs.tell(self._slave, x, p[self._second], x2, x3)

    def _read_law(self) -> None:
        """What the laws hold besides p: e - p, W'S and the gains (n,) or (n, D)."""
        u, network, phi, p = self._signals.read(self._slave).reshape(4, *self._shape)
        self._k, self._delta, epsilon = self._gains.read(self._slave).reshape(-1, 3).T[..., None]
        self._sharpness = EXTERNAL_STEP * self._delta / epsilon
        self._network = self._strict * network
        self._offset = -(u + self._strict * (network + phi)) / self._k - p

    def _control(self, k: int, p: FloatArray) -> FloatArray:
        """u = -k e - W'S - delta tanh(K delta e / epsilon)."""
        e = self._offset[k] + p
        robust = self._strict * self._delta[k] * np.tanh(self._sharpness[k] * e)
        return np.asarray(-self._k[k] * e - self._network[k] - robust)

    def _actions(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """x of all the players (n, D)."""
        actions = p.copy()
        actions[self._second] = x
        return actions

    def _asked(self, k: int, time: float, p: FloatArray, x: FloatArray, u: FloatArray) -> FloatArray:
        """The rate that a function gives. Raises SimulationError for what it raises and for other shapes."""
        number = self._numbers[k]
        v = p if self._second[k] else np.full_like(p, np.nan)
        return called(
            self._functions[k], (time, x.copy(), v.copy(), u), self._shape[1:], _plant(number, time)
        )


def _plant(number: int, time: float) -> str:
    return f"the plant of player {number} at {in_seconds(time)}"
