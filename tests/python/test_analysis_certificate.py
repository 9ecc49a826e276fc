"""Certificates and thresholds against the exact spectrum of the oracle's linear loop."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game.theory import paper_bounds
from mixed_order_game.theory.analyst import paper_thresholds
from mixed_order_game.theory.certificate import (
    Weights,
    best_certificate,
    proved_rate,
    sufficient_gains,
    theorem_2_rate,
    theorem_2_thresholds,
)
from mixed_order_game.theory.constants import NO_DYNAMICS, dynamics_constants, loop_constants
from mixed_order_game.theory.design import paper_constants
from mixed_order_game.theory.exact_loop import exact_ceiling, exact_loop, exact_threshold
from mixed_order_game.theory.game import AnalysedGame, Gains, read_game
from mixed_order_game.theory.paper_bounds import gains_above, gains_for_rate, thresholds
from mixed_order_game.theory.spectrum import linear_loop, spectral_abscissa
from tests.conftest import GAMES
from tests.oracle import game as oracle
from tests.oracle import linear_loop as oracle_loop

FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"
NAMES = [
    "five_vehicles",
    "interleaved_orders",
    "three_second_order",
    "four_first_order",
    "two_scalar_players",
]
K = ("k1", "k2", "k3", "k4")
FORMULAS = {
    "boundedness": paper_bounds.boundedness_coefficients,
    "theorem 1": paper_bounds.theorem_1_coefficients,
    "theorem 2": paper_bounds.theorem_2_coefficients,
}


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def files(name: str) -> Path:
    return FIVE_VEHICLES if name == "five_vehicles" else GAMES / f"{name}.toml"


def exact_rate(name: str, gains: Gains) -> float:
    """Slowest rate of the oracle's loop with other gains, 1/s."""
    game = oracle.read_game(files(name))
    return -oracle_loop.spectral_abscissa(replace(game, k1=gains.k1, k2=gains.k2, k3=gains.k3, k4=gains.k4))


def with_k(gains: Gains, k1: float, k2: float, k3: float, k4: float) -> Gains:
    return replace(gains, k1=k1, k2=k2, k3=k3, k4=k4)


def constants(game: AnalysedGame, p: float, *, dynamics: bool = True) -> paper_bounds.PaperConstants:
    local = dynamics_constants(game.parameters, 5.0, 5.0)
    if not dynamics:
        local = replace(NO_DYNAMICS, lipschitz=np.zeros(game.parameters.players))
    return paper_constants(game, loop_constants(game.parameters), p=p, dynamics=local)


def test_exact_loop_matches_the_oracle(name: str) -> None:
    game = read_game(files(name))
    found = exact_loop(game.parameters)
    assert -found.abscissa == pytest.approx(exact_rate(name, game.gains))
    other = oracle.read_game(files(name))
    times = np.linspace(0.0, 1.5 * found.settling_time, 600)
    states = oracle_loop.exact_solution(other, times)[:, : other.x0.size].reshape(-1, *other.x0.shape)
    x_star = states[0] * 0.0 + oracle_loop.exact_solution(other, np.array([200.0 / -found.abscissa]))[
        0, : other.x0.size
    ].reshape(other.x0.shape)
    error = np.linalg.norm((states - x_star).reshape(len(times), -1), axis=1)
    last = times[np.flatnonzero(error > 0.02 * error[0])[-1]]
    assert found.settling_time == pytest.approx(last, rel=0.01)


def test_all_graphs_of_the_example() -> None:
    """Slowest rate over the 728 connected graphs 2.976 1/s; all unstable with k = (5, 1, 5, 5)."""
    parameters = read_game(FIVE_VEHICLES).parameters
    loose = replace(parameters, k1=5.0, k3=5.0, k4=5.0)
    own, unstable = [], []
    for adjacency in oracle_loop.connected_graphs(5):
        own.append(-spectral_abscissa(linear_loop(replace(parameters, adjacency=adjacency))))
        unstable.append(spectral_abscissa(linear_loop(replace(loose, adjacency=adjacency))))
    assert len(own) == 728
    assert min(own) == pytest.approx(2.976, abs=5e-4)
    assert min(unstable) > 0.0
    assert not exact_loop(loose).stable
    assert exact_loop(loose).settling_time == math.inf


def test_exact_thresholds_are_edges() -> None:
    game = read_game(FIVE_VEHICLES)
    k3, k2 = exact_threshold(game.parameters, "k3"), exact_ceiling(game.parameters, "k2")
    for inside, gain, outside in ((1.002, "k3", 0.998), (0.998, "k2", 1.002)):
        value = k3 if gain == "k3" else k2
        stable, unstable = (replace(game.gains, **{gain: part * value}) for part in (inside, outside))
        assert exact_rate("five_vehicles", stable) > 0.0
        assert exact_rate("five_vehicles", unstable) < 0.0
    # Any k1 and, at k3 = 50 on the ring, any k4 do.
    assert exact_threshold(game.parameters, "k1") == 0.0


def test_thresholds_prove_what_they_say(name: str) -> None:
    """Gains just above the sharper thresholds have the asked rate; just below k3* no weights prove it."""
    game = read_game(files(name))
    c = loop_constants(game.parameters)
    g = dynamics_constants(game.parameters, 3.0, 4.0)
    for rate_part in (0.0, 1.0, 1.9):
        rate = rate_part * game.gains.k2 * c.monotonicity
        found = sufficient_gains(c, g, game.gains.k2, rate=rate, margin=1.5)
        gains = with_k(
            game.gains, 2.0 * found.k1 + 1e-3, game.gains.k2, 1.5 * found.k3, 1.01 * found.k4 + 1e-6
        )
        assert proved_rate(c, g, gains, found.weights) >= rate - 1e-9 * (1.0 + rate)
        assert math.isfinite(found.k4)
        below = replace(gains, k3=0.99 * found.k3, k1=1e6, k4=1e9)
        assert best_certificate(c, g, below).rate < rate + 1e-6


def test_proved_rates_never_exceed_the_exact_one(name: str) -> None:
    """Over random gains the certificates' rates of norms and the paper's are at most the slowest rate."""
    game = read_game(files(name))
    c = loop_constants(game.parameters)
    random = np.random.default_rng(8)
    proved = 0
    bare = theorem_2_thresholds(c, 1.0, margin=2.0)
    for _ in range(6):
        k2 = float(10.0 ** random.uniform(-2.0, 1.0))
        k3, k4 = (k2 * value * 10.0 ** random.uniform(-0.2, 1.0) for value in (bare.k3, bare.k4 + 1.0))
        gains = with_k(game.gains, float(10.0 ** random.uniform(-2.0, 3.0)), k2, float(k3), float(k4))
        exact = exact_rate(name, gains)
        rate = theorem_2_rate(c, gains)
        assert rate <= exact * (1.0 + 1e-6)
        proved += rate > 0.0
        whole = best_certificate(c, NO_DYNAMICS, gains).rate
        assert 0.5 * whole <= exact * (1.0 + 1e-6)
    assert proved >= 2
    for p in (0.01, 0.3):
        k = constants(game, p, dynamics=False)
        gains = gains_above(FORMULAS["theorem 2"], k, game.gains, 1.5)
        rate = FORMULAS["theorem 2"](k, gains).rate(k.pair)
        assert 0.0 < 0.5 * rate <= exact_rate(name, gains) * (1.0 + 1e-6)


@pytest.mark.parametrize("formula", FORMULAS)
def test_paper_thresholds_are_roots_and_ordered(name: str, formula: str) -> None:
    """Each coefficient is 0 at its own threshold, positive above, and rises with its own gain."""
    game = read_game(files(name))
    for p in (0.02, 0.4):
        c = constants(game, p, dynamics=formula != "theorem 2")
        gains = gains_above(FORMULAS[formula], c, game.gains, 1.2)
        limits = thresholds(FORMULAS[formula], c, gains)
        assert limits.met(gains)
        assert FORMULAS[formula](c, gains).smallest > 0.0
        for gain, coefficient in (
            ("k2", "actions"),
            ("k1", "tracking"),
            ("k3", "estimates"),
            ("k4", "velocities"),
        ):
            threshold = getattr(limits, gain)
            if threshold == 0.0:
                continue
            at = getattr(FORMULAS[formula](c, replace(gains, **{gain: threshold})), coefficient)
            above = getattr(FORMULAS[formula](c, replace(gains, **{gain: 1.1 * threshold})), coefficient)
            assert at == pytest.approx(0.0, abs=1e-9 * (1.0 + threshold))
            assert above > at
            assert not limits.met(replace(gains, **{gain: 0.999 * threshold}))


@pytest.mark.parametrize("formula", ["theorem 1", "theorem 2"])
def test_gains_above_every_threshold_shown_are_met_and_no_others(name: str, formula: str) -> None:
    """And the gains for which the thresholds are shown, raised just above them, are met too."""
    game = read_game(files(name))
    c = loop_constants(game.parameters)
    g = dynamics_constants(game.parameters, 5.0, 5.0)
    if formula == "theorem 2":
        g = replace(NO_DYNAMICS, lipschitz=np.zeros(game.parameters.players))
    random = np.random.default_rng(12)
    for _ in range(6):
        gains = with_k(game.gains, *(10.0 ** random.uniform(-1.0, 8.0, size=4)).tolist())
        shown = paper_thresholds(game.with_gains(gains), c, FORMULAS[formula], g)
        assert shown.met == shown.limits.met(gains)
        raised = {gain: max(getattr(shown.counted, gain), 1.001 * getattr(shown.limits, gain)) for gain in K}
        assert paper_thresholds(game.with_gains(replace(gains, **raised)), c, FORMULAS[formula], g).met


def test_gains_above_the_sharper_thresholds_shown_have_a_rate(name: str) -> None:
    """k4* is that for the given k3 where this exceeds k3*, and no gains just below k3* have a rate."""
    game = read_game(files(name))
    c = loop_constants(game.parameters)
    random = np.random.default_rng(13)
    for _ in range(3):
        k1, k2, part = 10.0 ** random.uniform([-2.0, -1.0, 0.005], [2.0, 1.0, 2.0])
        k3 = theorem_2_thresholds(c, k2, margin=3.0).k3
        gains = with_k(game.gains, k1, k2, k3 * part, 1.0)
        k4 = theorem_2_thresholds(c, k2, margin=3.0, given=gains).k4
        assert theorem_2_rate(c, replace(gains, k4=1.02 * k4 + 1e-3)) > 0.0
        assert theorem_2_rate(c, replace(gains, k3=0.99 * k3, k4=1e9)) <= 1e-6


def test_gains_for_a_rate_have_it(name: str) -> None:
    game = read_game(files(name))
    for p, rate in ((0.02, 1.0), (0.4, 300.0)):
        c = constants(game, p)
        gains = gains_for_rate(FORMULAS["theorem 1"], c, game.gains, rate)
        rounding = 4.0 * np.finfo(float).eps * max(gains.k1, gains.k3, gains.k4) / min(1.0, c.pair.smallest_P)
        assert FORMULAS["theorem 1"](c, gains).rate(c.pair) == pytest.approx(rate, rel=1e-9, abs=rounding)


def test_rates_rise_with_k1_and_k4(name: str) -> None:
    game = read_game(files(name))
    c = loop_constants(game.parameters)
    random = np.random.default_rng(9)
    for _ in range(20):
        weights = Weights(*(10.0 ** random.uniform(-3.0, 0.0, size=3)).tolist())
        gains = with_k(game.gains, *(10.0 ** random.uniform(-1.0, 4.0, size=4)).tolist())
        rate = proved_rate(c, NO_DYNAMICS, gains, weights)
        for gain in ("k1", "k4"):
            more = replace(gains, **{gain: 3.0 * getattr(gains, gain)})
            assert proved_rate(c, NO_DYNAMICS, more, weights) >= rate - 1e-9 * abs(rate)


def test_k1_has_no_threshold_without_unknown_dynamics() -> None:
    """The spectrum is {-k1, n times} and a rest without k1, so the k1* of Theorem 2 is an artefact."""
    game = read_game(FIVE_VEHICLES)

    def spectrum(k1: float) -> list[complex]:
        values = np.linalg.eigvals(linear_loop(replace(game.parameters, k1=k1)))
        return sorted(values.tolist(), key=lambda value: (round(value.real, 6), value.imag))

    slow, fast = spectrum(0.01), spectrum(777.0)
    for values, k1 in ((slow, 0.01), (fast, 777.0)):
        assert sum(abs(value + k1) < 1e-6 for value in values) == 3
    rest = [
        [value for value in values if abs(value + k1) > 1e-6] for values, k1 in ((slow, 0.01), (fast, 777.0))
    ]
    assert np.sort([value.real for value in rest[0]])[-6:] == pytest.approx(
        np.sort([value.real for value in rest[1]])[-6:], abs=1e-3
    )


def test_k2_has_no_threshold_without_unknown_dynamics() -> None:
    """At k2 = 0.01, far below 5 / (2 m), the certificate proves a rate; thresholds are proportional to k2."""
    game = read_game(FIVE_VEHICLES)
    c = loop_constants(game.parameters)
    small, one = theorem_2_thresholds(c, 0.01, margin=3.0), theorem_2_thresholds(c, 1.0, margin=3.0)
    assert small.k3 == pytest.approx(0.01 * one.k3, rel=1e-6)
    assert small.k4 == pytest.approx(0.01 * one.k4, rel=1e-4)
    gains = with_k(game.gains, 1.0, 0.01, 3.0 * small.k3, 1.1 * small.k4)
    assert theorem_2_rate(c, gains) > 0.0
    assert exact_rate("five_vehicles", gains) > 0.0
    assert gains.k2 < thresholds(FORMULAS["theorem 2"], constants(game, 0.1, dynamics=False), gains).k2


def test_k4_need_not_grow_with_k3() -> None:
    """The paper's k4* grows as k3^2; the sharper one stays bounded as k3 grows."""
    game = read_game(FIVE_VEHICLES)
    c = loop_constants(game.parameters)
    sharper = [theorem_2_thresholds(c, 1.0, margin=margin).k4 for margin in (10.0, 100.0, 1000.0)]
    printed = []
    k = constants(game, 0.1, dynamics=False)
    for k3 in (1e3, 1e4, 1e5):
        gains = with_k(game.gains, 1.0, 1.0, k3, 1.0)
        printed.append(thresholds(FORMULAS["theorem 2"], k, gains).k4)
    assert max(sharper) < 1.5 * min(sharper)
    assert printed[2] / printed[1] == pytest.approx(100.0, rel=1e-3)


def test_nothing_is_proved_without_monotonicity_or_connection() -> None:
    game = read_game(FIVE_VEHICLES)
    for changes in ({"adjacency": np.zeros((5, 5))}, {"cost_quadratic": np.full(5, -1.0)}):
        parameters = replace(game.parameters, **changes)
        found = theorem_2_thresholds(loop_constants(parameters), 1.0)
        assert found.k3 == math.inf
