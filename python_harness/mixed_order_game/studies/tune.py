"""Gains that settle in a wished time with little control energy, on one graph or on all graphs of a set.

First the loop of Theorem 2 alone, which is linear, for costs with expressions near x*: its settling time by
the matrix exponential and its control energy by a Lyapunov equation cost milliseconds, and SciPy's
differential evolution searches there.
Then the real loop, through the FMU: the wish is tightened until every graph's run meets it, and a few dozen
runs of Nelder and Mead's simplex lower the energy further. What is returned was simulated on every graph.
The linear loop knows no perturbation, so a largest error at the end is sought by the simplex alone. Where
that loop is too large, everything is.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arguments import number_argument
from ..errors import MixedOrderGameError, SimulationError
from ..fmu.build import GameSource
from ..fmu.model import Model, Value, check_value
from ..game.graphs import CommunicationGraph, graph_of
from ..game.parameters import GAINS_OF_ORDER, GameParameters, game_parameters, moves
from ..interrupts import noted_signals
from ..notebook import digits, page, paragraph, table
from ..results.metrics import METRIC_UNITS, SETTLED, Metrics, told_figure
from ..theory.linearized import LARGEST as LARGEST_LINEAR
from ..theory.linearized import linearized_loop
from ..theory.spectrum import initial_deviation, linear_loop, owners, spectral_abscissa
from .designs import Range
from .pool import open_pool, run_cases
from .sampler import Sampler, Settings
from .worker import Case

FloatArray = NDArray[np.float64]

LINEAR_GAINS = ("k1", "k2", "k3", "k4")
"""Gains that the linear loop knows; others, such as delta, are tuned by simulation alone."""

DEFAULT_RANGES: Mapping[str, Range] = {
    "k1": Range(0.5, 100.0, logarithmic=True),
    "k2": Range(0.1, 20.0, logarithmic=True),
    "k3": Range(1.0, 500.0, logarithmic=True),
    "k4": Range(1.0, 500.0, logarithmic=True),
    "delta": Range(0.1, 100.0, logarithmic=True),
    "beta": Range(1.0, 1000.0, logarithmic=True),
    "epsilon": Range(0.001, 1.0, logarithmic=True),
}
"""Where gains are sought unless told otherwise; k1 to k4 in 1/s."""

ROUNDS = 8
POLISH_RUNS = 60
HARDEST = 4
"""Graphs that the first stage keeps in view at most; all are checked after it."""

WINDOW = 40
STEPS = 100
SLACK = 0.02
LARGEST_DENSE = 200
"""States of a coordinate's loop up to which dense matrices are used: 13 players have 195."""

UNSTABLE = 1e3
MISSED = 30.0
"""Weight of log(error / band) at the wished time, of log(time / wish) and of log(final error / largest error)
against the logarithm of the energy."""

MARGIN = 0.995
"""Part of a wish at which the simplex aims."""

REPEATS = 5
"""Most simplex searches, each from the best point of the one before, while a largest error is not kept."""

AT_LIMIT = 0.01
"""Relative distance from an end of its range within which a gain is said to lie there."""

WORSE = 1.1
"""Factor from which on a larger final error is told."""

ROUNDING = 1e-12
"""Of a control at its bound."""

CHEAPER, FARTHER = -0.15, 0.3
"""First steps of the simplex in the gains' logarithms: smaller gains save energy, larger ones reject more."""

TIGHTENING = 0.95
LEAST_TARGET = 0.05


class TuneError(MixedOrderGameError, ValueError):
    """A wish that makes no sense."""


@dataclass(frozen=True, repr=False)
class Tuned:
    """Gains found and the runs that prove them. met is false if no gains in the ranges were found to do."""

    gains: Mapping[str, float]
    ranges: Mapping[str, Range]  # where they were sought
    wish: float  # s
    largest_error: float | None  # wished, of |x - x*| in the last fifth of the runs
    graphs: tuple[CommunicationGraph, ...]
    metrics: tuple[Metrics | None, ...]  # one a graph, by simulation; None where the FMU gave up
    start_gains: Mapping[str, float]  # what the game came with
    start_metrics: tuple[Metrics | None, ...]
    slowest_rate: float
    """1/s, smallest over the graphs: minus the spectral abscissa of the linear loop; NaN if too large"""
    simulations: int = field(default=0)
    interrupted: bool = False  # by Ctrl-C: the gains are the best so far
    least_bound: float = float("inf")  # of the controls, u_max; infinite where there is none

    @property
    def met(self) -> bool:
        """Whether every graph's run settles in time and keeps the largest error wished."""
        return self.settles and self.exact

    @property
    def settles(self) -> bool:
        """Whether every graph's run settles in time."""
        return self.settling_time <= self.wish

    @property
    def exact(self) -> bool:
        """Whether every graph's run keeps the largest error; true if none is wished."""
        return self.largest_error is None or self.final_error <= self.largest_error

    @property
    def final_error(self) -> float:
        """Largest |x - x*| in the last fifth of the runs, over the graphs."""
        return _final_error(self.metrics)

    @property
    def start_final_error(self) -> float:
        """The same with the gains that the game came with."""
        return _final_error(self.start_metrics)

    @property
    def at_limits(self) -> dict[str, float]:
        """Gains that lie at an end of their range, with that end."""
        return {
            name: end
            for name, value in self.gains.items()
            for end in (self.ranges[name].low, self.ranges[name].high)
            if abs(np.log(value / end)) <= AT_LIMIT
        }

    @property
    def notes(self) -> list[str]:
        """What is to be known of the gains, in sentences: ends of their ranges, a larger error, bounds."""
        notes = [
            f"{name} = {self.gains[name]:g} lies at an end of its range, {each.low:g} to {each.high:g}:"
            " a wider one may do better"
            for name, each in self.ranges.items()
            if name in self.at_limits
        ]
        if np.isnan(self.slowest_rate):
            notes.append(
                "the linear loop is too large: gains were sought by simulation alone, near the given ones"
            )
        before, after = self.start_final_error, self.final_error
        if after > WORSE * before:
            times = f"{after / before:.3g} times" if before > 0.0 else "beyond"
            told = f"the final error {after:.4g} is {times} that before, {before:.4g}"
            notes.append(told + ("" if self.largest_error else "; a largest error can be wished"))
        peak = max((found.control_peak for found in self.metrics if found is not None), default=0.0)
        if peak >= self.least_bound * (1.0 - ROUNDING):
            notes.append(
                f"controls come up to {peak:.4g}, the least u_max is {self.least_bound:g}: where one is at "
                "its bound, the run tells of these initial values alone"
            )
        return notes

    @property
    def worst(self) -> int:
        """Index of the graph that settles last; one that does not settle comes before all."""
        return int(np.argmax([_settling(found) for found in self.metrics]))

    @property
    def settling_time(self) -> float:
        """Longest settling time over the graphs in s; infinite if one does not settle."""
        return max(_settling(found) for found in self.metrics)

    @property
    def control_energy(self) -> float:
        """Largest integral of |u|^2 over the graphs."""
        return _largest_energy(self.metrics)

    def __repr__(self) -> str:
        gains = ", ".join(f"{name} = {value:.4g}" for name, value in self.gains.items())
        met = "met" if self.met else "not met"
        return f"<Tuned {gains}: settles within {self.settling_time:.4g} s, the wish is {met}>"

    def _repr_html_(self) -> str:
        """For notebooks: the gains and what the slowest graph's run shows, before and after."""
        before, after = self.start_metrics[self.worst], self.metrics[self.worst]
        rows: list[tuple[str, ...]] = [
            (name, digits(self.start_gains[name]), digits(value)) for name, value in self.gains.items()
        ]
        for name, unit in METRIC_UNITS.items():
            cells = (told_figure(each, name, 4) for each in (before, after))
            rows.append((name.replace("_", " ") + (f" ({unit})" if unit else ""), *cells))
        notes = [paragraph(note) for note in self.notes]
        return page(repr(self)[1:-1], table(["", "before", "tuned"], rows), *notes)

    def as_json(self) -> dict[str, Any]:
        """Plain values for json.dumps."""
        worst, before = self.metrics[self.worst], self.start_metrics[self.worst]
        return {
            "gains": dict(self.gains),
            "met": self.met,
            "wish": self.wish,
            "settling_time": self.settling_time if np.isfinite(self.settling_time) else None,
            "largest_error": self.largest_error,
            "final_error": self.final_error if np.isfinite(self.final_error) else None,
            "start_final_error": self.start_final_error if np.isfinite(self.start_final_error) else None,
            "at_limits": self.at_limits,
            "notes": self.notes,
            "control_energy": self.control_energy if np.isfinite(self.control_energy) else None,
            "slowest_rate": self.slowest_rate if np.isfinite(self.slowest_rate) else None,
            "graphs": len(self.graphs),
            "simulations": self.simulations,
            "interrupted": self.interrupted,
            "worst_graph": self.graphs[self.worst].label,
            "metrics": None if worst is None else worst.as_json(),
            "start_gains": dict(self.start_gains),
            "start_metrics": None if before is None else before.as_json(),
        }


Progress = Callable[[str, float], None]
"""Called with what is being done and the part of it done, 0 to 1."""


def tune(
    game: GameSource,
    settling_time: float,
    *,
    graphs: Sequence[CommunicationGraph] | None = None,
    gains: Sequence[str] | None = None,
    ranges: Mapping[str, Range] | None = None,
    start_values: Mapping[str, Value] | None = None,
    band: float | None = None,
    largest_error: float | None = None,
    stop_time: float | None = None,
    seed: int = 0,
    jobs: int | None = 1,
    progress: Progress | None = None,
) -> Tuned:
    """Seek gains that settle in a wished time with little control energy, on every graph.

    Ctrl-C ends the search with the best gains that were simulated on every graph so far, or raises
    KeyboardInterrupt before the first.

    Parameters
    ----------
    game
        An FMU (.fmu), a game file (.toml), a game of the package by its name, a `Game`; the paper's example
        for None.
    settling_time
        Wish in s: the norm of x - x* stays within the band from here on.
    graphs
        Graphs to tune for; default the game's own.
    gains
        Names of the gains to tune; default k1 to k4, without k1 or k4 where no player has order 1 or 2.
    ranges
        Where gains are sought; default `DEFAULT_RANGES`.
    start_values
        Parameters that all runs share.
    band
        Norm of x - x* that counts as settled, in the game's length unit; default 2 % of the initial one.
    largest_error
        Largest |x - x*| in the last fifth of the runs that verify; default any.
    stop_time
        Length of the runs that verify in s; default four times `settling_time`, at least 2 s.
    seed
        Of the search.
    jobs
        Processes that simulate many graphs; a script that asks for several guards its main module.
    progress
        Called with what is being done and the part of it done, 0 to 1.

    Returns
    -------
    Tuned
        The gains and the runs that prove them, one a graph.

    Raises
    ------
    TuneError
        For a wish without sense (a ValueError, too).
    VariableError, GraphError
        For gains, values and graphs that the FMU does not take.

    Examples
    --------
    >>> found = mog.tune("energy_consumption", 2.0, gains=["k2"])
    >>> found.met
    True
    """
    settling_time = number_argument(settling_time, "settling_time", TuneError)
    if stop_time is not None:
        stop_time = number_argument(stop_time, "stop_time", TuneError)
    if not (np.isfinite(settling_time) and settling_time > 0.0):
        raise TuneError(f"the settling time {settling_time:g} s is not positive")
    if largest_error is not None and not (np.isfinite(largest_error) and largest_error > 0.0):
        raise TuneError(f"the largest error {largest_error:g} is not positive")
    stop = max(2.0, 4.0 * settling_time) if stop_time is None else stop_time
    if stop <= settling_time:
        raise TuneError(f"runs of {stop:g} s cannot show that {settling_time:g} s are met")
    with _Search(
        game, settling_time, graphs, gains, ranges or {}, start_values or {}, band, largest_error, stop, jobs
    ) as search:
        return search.run(seed, progress or (lambda _name, _part: None))


class _Search:
    """The game, the graphs and the ranges of one search; gains are vectors of logarithms in the box."""

    def __init__(
        self,
        fmu: GameSource,
        wish: float,
        graphs: Sequence[CommunicationGraph] | None,
        gains: Sequence[str] | None,
        ranges: Mapping[str, Range],
        start_values: Mapping[str, Value],
        band: float | None,
        largest_error: float | None,
        stop: float,
        jobs: int | None,
    ) -> None:
        self.settings = Settings(stop_time=stop, band=band)
        self.wish = wish
        self.largest_error = largest_error
        self.jobs = jobs
        self.fixed = dict(start_values)
        self.simulations = 0
        self.best: tuple[dict[str, float], list[Metrics | None]] | None = None  # on all graphs, so far
        self.take_signals: Callable[[], None] = lambda: None
        self.sampler = Sampler(fmu)
        try:
            self._prepare(graphs, gains, ranges, band)
        except BaseException:
            self.sampler.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.sampler.close()

    def _prepare(
        self,
        graphs: Sequence[CommunicationGraph] | None,
        gains: Sequence[str] | None,
        ranges: Mapping[str, Range],
        band: float | None,
    ) -> None:
        model = self.sampler.model
        self.names = _moving(model) if gains is None else tuple(gains)
        self.fixed = model.expanded(self.fixed)
        if not self.names or len(set(self.names)) != len(self.names):
            raise TuneError("name every gain to tune once")
        _require_common_gains(model)
        unknown = [name for name in (*self.names, *ranges) if name not in DEFAULT_RANGES]
        if unknown:
            raise TuneError(f"{unknown[0]} is not a gain: one of {', '.join(DEFAULT_RANGES)} expected")
        _require_moving(model, (*self.names, *ranges))
        clash = [name for name in self.names if name in self.fixed]
        if clash:
            raise TuneError(f"{clash[0]} is both tuned and set")
        idle = [name for name in ranges if name not in self.names]
        if idle:
            raise TuneError(f"{idle[0]} has a range but is not tuned")
        self.box = {name: ranges.get(name, DEFAULT_RANGES[name]) for name in self.names}
        for name, each in self.box.items():
            if each.low <= 0.0:
                raise TuneError(f"the range of {name} does not begin above 0")
            check_value(model.variable(name), each.low)
            check_value(model.variable(name), each.high)
        self.game = self._game()
        self.graphs = (graph_of(self.game.adjacency),) if graphs is None else tuple(graphs)
        if not self.graphs:
            raise TuneError("there is no graph to tune for")
        self.edges = [{}] if graphs is None else [graph.start_values(model) for graph in self.graphs]
        self.loops = [graph.adjacency for graph in self.graphs]
        self.deviation = initial_deviation(self.game)
        self.actions = len(owners(self.game))
        distance = float(np.linalg.norm(self.deviation[: self.actions]))
        rounding = 1e-12 * (1.0 + float(np.abs(self.game.x0).max()))
        if band is None and distance <= rounding:
            raise TuneError("every player starts at its equilibrium: give the band that counts as settled")
        self.band = SETTLED * distance if band is None else band
        if self.band <= 0.0:
            raise TuneError(f"the band {self.band:g} is not positive")
        self.start = {name: float(model.start_values(self.fixed)[name]) for name in self.names}

    def _game(self) -> GameParameters:
        """What the linear loop takes: x* and the Jacobian there, too, where a cost has an expression."""
        model = self.sampler.model
        if "cost" in model.expressions:
            return linearized_loop(self.sampler, self.fixed).game
        return game_parameters(model, self.fixed)

    def run(self, seed: int, progress: Progress) -> Tuned:
        """Both stages, or what is known when Ctrl-C comes."""
        start_metrics: list[Metrics | None] = []
        interrupted = False
        try:
            with noted_signals() as self.take_signals:
                start_metrics = self.simulate(self.start)
                gains, found = self._sought(seed, progress)
        except KeyboardInterrupt:
            if self.best is None:
                raise
            gains, found = self.best
            interrupted = True
        return Tuned(
            gains=gains,
            ranges=self.box,
            wish=self.wish,
            largest_error=self.largest_error,
            graphs=self.graphs,
            metrics=tuple(found),
            start_gains=self.start,
            start_metrics=tuple(start_metrics),
            slowest_rate=self._slowest_rate(gains),
            simulations=self.simulations,
            interrupted=interrupted,
            least_bound=float(self.game.u_max.min()),
        )

    def _sought(self, seed: int, progress: Progress) -> tuple[dict[str, float], list[Metrics | None]]:
        point, found = self._robust(seed, progress)
        for _ in range(REPEATS):
            worth = self._worth(found)
            point, found = self._polished(point, found, progress)
            if self._exact_enough(found) or self._worth(found) >= worth:
                break
        return self.gains(point), found

    def gains(self, point: FloatArray) -> dict[str, float]:
        """Gains of a point, rounded to four digits, within the box."""
        rounded = {}
        for (name, each), value in zip(self.box.items(), np.exp(point), strict=True):
            rounded[name] = min(max(float(f"{value:.4g}"), each.low), each.high)
        return rounded

    def parameters(self, gains: Mapping[str, float], adjacency: FloatArray) -> GameParameters:
        """The game's parameters for the linear loop."""
        known = {name: value for name, value in gains.items() if name in LINEAR_GAINS}
        return replace(self.game, adjacency=adjacency, **known)  # type: ignore[arg-type]

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper corner of the box in logarithms."""
        corners = [(each.low, each.high) for each in self.box.values()]
        lower, upper = np.log(np.array(corners)).T
        return lower, upper

    @property
    def states(self) -> int:
        """Of the linear loop, of one coordinate where coordinates are alike."""
        return self.actions * (self.game.players + 2)

    @property
    def small(self) -> bool:
        """Whether an evaluation of the linear loop costs milliseconds."""
        return self.states <= LARGEST_DENSE

    def _slowest_rate(self, gains: Mapping[str, float]) -> float:
        """Of the linear loop on the graph where it is slowest, in 1/s; NaN for too many states."""
        if self.states > LARGEST_LINEAR:
            return float("nan")
        return min(-spectral_abscissa(linear_loop(self.parameters(gains, a))) for a in self.loops)

    def _robust(self, seed: int, progress: Progress) -> tuple[FloatArray, list[Metrics | None]]:
        """Points of the linear stage until one of them meets the wish in simulation, or the best of them.

        Where there is no linear stage, that is the game's own point.
        """
        if self.states > LARGEST_LINEAR:
            own = self._own()
            return own, self.simulate(self.gains(own))
        active = [int(np.argmin([_connectivity(adjacency) for adjacency in self.loops]))]
        target = self.wish
        point: FloatArray | None = None
        best: tuple[float, FloatArray, list[Metrics | None]] = (np.inf, np.empty(0), [])
        for number in range(ROUNDS):
            progress("linear loop", number / ROUNDS)
            point = self._linear(active, target, seed, point)
            violations = np.array([self._violation(point, adjacency, target) for adjacency in self.loops])
            hardest = int(np.argmax(violations))
            if violations[hardest] > 0.0 and hardest not in active and number < ROUNDS - 1:
                active = [*active[-(HARDEST - 1) :], hardest]
                continue
            progress("simulation", number / ROUNDS)
            found = self.simulate(self.gains(point))
            times = [_settling(each) for each in found]
            longest = max(times)
            if not best[2] or longest < best[0]:
                best = (longest, point, found)
            if longest <= self.wish:
                break
            worst = int(np.argmax(times))
            if worst not in active:
                active = [*active[-(HARDEST - 1) :], worst]
            ratio = self.wish / longest if np.isfinite(longest) else 0.5
            target = max(LEAST_TARGET * self.wish, target * TIGHTENING * ratio)
        return best[1], best[2]

    def _linear(
        self, active: Sequence[int], target: float, seed: int, known: FloatArray | None
    ) -> FloatArray:
        """Least energy of the linear loop over the active graphs, from a point known to be near if any."""
        from scipy.optimize import Bounds, differential_evolution

        linear = [k for k, name in enumerate(self.names) if name in LINEAR_GAINS]
        point = self._own()
        if not linear:
            return point

        def cost(part: FloatArray) -> float:
            self.take_signals()
            point[linear] = part
            return max(self._linear_cost(point, self.loops[k], target) for k in active)

        lower, upper = self.bounds
        box = Bounds(lower[linear], upper[linear])
        found = differential_evolution(
            cost,
            box,
            rng=seed,
            popsize=8 if self.small else 5,
            maxiter=12 if known is not None or not self.small else 40,
            tol=0.01,
            x0=None if known is None else np.clip(known[linear], lower[linear], upper[linear]),
            polish=False,
            init="sobol",
        )
        point[linear] = found.x
        return point

    def _linear_cost(self, point: FloatArray, adjacency: FloatArray, target: float) -> float:
        loop = linear_loop(self.parameters(self._exact(point), adjacency))
        if len(loop) > LARGEST_DENSE:
            energy, overrun = self._stepped(loop, target)
            return float(np.log(energy) + MISSED * max(0.0, overrun))
        abscissa = spectral_abscissa(loop)
        if abscissa >= 0.0:
            return UNSTABLE + abscissa
        violation = max(0.0, self._overrun(loop, target))
        return float(np.log(linear_energy(loop, self.game, self.deviation)) + MISSED * violation)

    def _violation(self, point: FloatArray, adjacency: FloatArray, target: float) -> float:
        loop = linear_loop(self.parameters(self.gains(point), adjacency))
        if len(loop) > LARGEST_DENSE:
            return self._stepped(loop, target)[1] - SLACK
        abscissa = spectral_abscissa(loop)
        return UNSTABLE + abscissa if abscissa >= 0.0 else self._overrun(loop, target) - SLACK

    def _overrun(self, loop: FloatArray, target: float) -> float:
        """log(largest norm of x - x* / band) from the target time on, to twice that time."""
        from scipy.linalg import expm

        state = expm(loop * target) @ self.deviation
        step = expm(loop * (target / WINDOW))
        largest = 0.0
        for _ in range(WINDOW + 1):
            largest = max(largest, float(np.linalg.norm(state[: self.actions])))
            state = step @ state
        return float(np.log(max(largest, np.finfo(float).tiny) / self.band))

    def _stepped(self, loop: FloatArray, target: float) -> tuple[float, float]:
        """Energy and overrun of a large loop, by steps of a hundredth of the target time."""
        control = loop[_driven(self.game)]
        states = np.array(list(stiff_response(loop, self.deviation, target / STEPS, 2 * STEPS)))
        with np.errstate(over="ignore", invalid="ignore"):
            power = np.square(np.einsum("cn,tnl->tcl", control, states)).sum(axis=(1, 2))
            energy = 0.5 * float(np.sum(power[1:] + power[:-1])) * target / STEPS
            largest = float(np.linalg.norm(states[STEPS:, : self.actions], axis=(1, 2)).max())
        if not (np.isfinite(energy) and np.isfinite(largest)):
            return float(np.exp(UNSTABLE / 10.0)), UNSTABLE
        return energy, float(np.log(max(largest, np.finfo(float).tiny) / self.band))

    def _own(self) -> FloatArray:
        """The game's own gains, or the nearest ones in the box."""
        point = np.log([self.start[name] for name in self.names])
        return np.asarray(np.clip(point, *self.bounds))

    def _exact(self, point: FloatArray) -> dict[str, float]:
        return dict(zip(self.names, np.exp(point).tolist(), strict=True))

    def _polished(
        self, point: FloatArray, found: list[Metrics | None], progress: Progress
    ) -> tuple[FloatArray, list[Metrics | None]]:
        """Less energy by simulation on the hardest graphs, at most three; kept if all graphs agree."""
        from scipy.optimize import Bounds, minimize

        hardest = {*np.argsort([_settling(each) for each in found])[-2:].tolist()}
        if self.largest_error is not None:
            hardest.add(int(np.argmax([_final_error([each]) for each in found])))
        scale = self._worth(found)
        runs = 0

        def cost(trial: FloatArray) -> float:
            nonlocal runs
            runs += 1
            progress("polishing", min(1.0, runs / POLISH_RUNS))
            gains = self.gains(trial)
            trials = [self._one(gains, k) for k in sorted(hardest)]
            if len(hardest) == len(self.graphs):
                self._consider(gains, trials)
            return self._worth(trials) - scale

        step = CHEAPER if self._exact_enough(found) else FARTHER
        simplex = np.vstack([point, point + np.diag(np.full(len(point), step))])
        lower, upper = self.bounds
        options: Any = {
            "maxfev": POLISH_RUNS,
            "initial_simplex": np.clip(simplex, lower, upper),
            "xatol": 1e-3,
        }
        better = minimize(cost, point, method="Nelder-Mead", bounds=Bounds(lower, upper), options=options)
        checked = self.simulate(self.gains(better.x))
        if self._worth(checked) < scale:
            return np.asarray(better.x), checked
        return point, found

    def _worth(self, found: Sequence[Metrics | None]) -> float:
        """What polishing lowers: the logarithm of the energy, plus penalties for late settling and errors."""
        longest, energy = max(_settling(each) for each in found), _largest_energy(found)
        if not np.isfinite(longest):
            return UNSTABLE
        late = max(0.0, float(np.log(longest / (MARGIN * self.wish))))
        return float(np.log(energy)) + MISSED * (late + self._excess(found))

    def _excess(self, found: Sequence[Metrics | None]) -> float:
        """log(final error / largest error), at least 0."""
        if self.largest_error is None:
            return 0.0
        return max(0.0, float(np.log(_final_error(found) / (MARGIN * self.largest_error))))

    def _exact_enough(self, found: Sequence[Metrics | None]) -> bool:
        return self.largest_error is None or _final_error(found) <= self.largest_error

    def _one(self, gains: Mapping[str, float], graph: int) -> Metrics | None:
        self.take_signals()
        self.simulations += 1
        try:
            return self.sampler.measure({**self.fixed, **self.edges[graph], **gains}, self.settings)
        except SimulationError:
            return None

    def simulate(self, gains: Mapping[str, float]) -> list[Metrics | None]:
        """Figures of every graph's run; the best so far is kept."""
        found = self._simulated(gains)
        self._consider(gains, found)
        return found

    def _consider(self, gains: Mapping[str, float], found: list[Metrics | None]) -> None:
        if self.best is None or self._worth(found) < self._worth(self.best[1]):
            self.best = dict(gains), found

    def _simulated(self, gains: Mapping[str, float]) -> list[Metrics | None]:
        """In this process or, for many graphs, in several."""
        if self.jobs == 1 or len(self.graphs) < 16:  # noqa: PLR2004 - starting processes costs as much
            return [self._one(gains, k) for k in range(len(self.graphs))]
        values = [{**self.fixed, **edges, **gains} for edges in self.edges]
        self.simulations += len(values)
        found: list[Metrics | None] = [None] * len(values)
        pool = open_pool(self.sampler.model, jobs=self.jobs)
        try:
            cases = [Case(k, each) for k, each in enumerate(values)]
            for outcomes in run_cases(pool, self.settings, cases, len(cases), ready=self.take_signals):
                for outcome in outcomes:
                    found[outcome.row] = outcome.metrics
        finally:
            pool.close()
        return found


def linear_energy(loop: FloatArray, game: GameParameters, deviation: FloatArray) -> float:
    """Integral of |u|^2 from 0 to infinity of the loop s' = M s (n, n), stable, from the deviation (n, D).

    There u = C s with the rows of M that drive the plant: x_i' = u_i (order 1), v_i' = u_i (order 2). So the
    integral is sum_l s_l' P s_l with M' P + P M = -C' C.
    """
    from scipy.linalg import solve_continuous_lyapunov

    control = loop[_driven(game)]
    P = solve_continuous_lyapunov(loop.T, -control.T @ control)
    return float(np.einsum("nl,nm,ml->", deviation, P, deviation))


def stiff_response(loop: FloatArray, deviation: FloatArray, step: float, steps: int) -> Iterator[FloatArray]:
    """States (n, D) of s' = M s at 0, step, ..., by the L-stable two-stage SDIRK method of order 2.

    For loops with many players, whose matrix is sparse; both stages share one factorization.
    """
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import splu

    matrix = csc_array(loop)
    part = 1.0 - np.sqrt(0.5)
    solver = splu(csc_array(eye_array(len(loop)) - part * step * matrix))
    state = deviation
    yield state
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(steps):
            first = solver.solve(np.asarray(matrix @ state))
            second = solver.solve(np.asarray(matrix @ (state + (1.0 - part) * step * first)))
            state = state + step * ((1.0 - part) * first + part * second)
            yield state


def _driven(game: GameParameters) -> NDArray[np.int_]:
    """Rows of M whose derivative is the control: x_i of order 1, v_i of order 2."""
    of = owners(game)
    return np.where(game.first_order[of], 0, len(of)) + np.arange(len(of))


def _require_common_gains(model: Model) -> None:
    if any(name not in model.variables for name in DEFAULT_RANGES):
        raise TuneError(
            "tune takes one gain of each kind for all players, and those of this game have their own"
        )


def _moving(model: Model) -> tuple[str, ...]:
    """Gains of the linear loop, without k1 or k4 where no player has order 1 or 2."""
    return tuple(name for name in LINEAR_GAINS if moves(name, model.order))


def _require_moving(model: Model, names: Sequence[str]) -> None:
    for name in names:
        if not moves(name, model.order):
            raise TuneError(f"{name} moves no player of this game: none has order {GAINS_OF_ORDER[name]}")


def _connectivity(adjacency: FloatArray) -> float:
    return float(np.sort(np.linalg.eigvals(np.diag(adjacency.sum(axis=1)) - adjacency).real)[1])


def _settling(found: Metrics | None) -> float:
    return float("inf") if found is None or np.isnan(found.settling_time) else found.settling_time


def _largest_energy(found: Sequence[Metrics | None]) -> float:
    return max(float("inf") if each is None else each.control_energy for each in found)


def _final_error(found: Sequence[Metrics | None]) -> float:
    return max(float("inf") if each is None else each.final_error for each in found)
