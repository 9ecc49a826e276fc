"""Constants over a box are never on the wrong side of samples of formulas by hand.

Certificates with them never prove more than happens.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.game.bounds import GameBounds, box_around, game_bounds
from mixed_order_game.game.equilibrium import judge_equilibrium
from mixed_order_game.game.parameters import game_parameters
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.certificate import best_certificate
from mixed_order_game.theory.constants import NO_DYNAMICS, dynamics_constants, loop_constants
from mixed_order_game.theory.game import game_of_model, read_game
from tests.bench.larger_games import seekers
from tests.games_by_hand import BY_HAND, fewer_households
from tests.oracle.general_loop import Functions, own_gradients
from tests.random_expressions import random_game
from tests.three_players import head

FloatArray = NDArray[np.float64]
GAMES = Path(__file__).resolve().parents[2] / "modelDescription" / "games"
POINTS = 40
STEP = 1e-5


def gradient_jacobian(functions: Functions, x: FloatArray) -> FloatArray:
    """(N D, N D) by central differences of gradients that are exact."""
    N, D = x.shape

    def gradients(at: FloatArray) -> FloatArray:
        return own_gradients(functions.costs, np.broadcast_to(at.reshape(N, D), (N, N, D))).ravel()

    steps = STEP * np.eye(x.size)
    columns = [(gradients(x.ravel() + step) - gradients(x.ravel() - step)) / (2.0 * STEP) for step in steps]
    return np.array(columns).T


def dynamics_jacobian(functions: Functions, x: FloatArray) -> FloatArray:
    """(N D, N D) by central differences."""
    still = np.zeros_like(x)
    steps = STEP * np.eye(x.size).reshape(-1, *x.shape)
    columns = [
        (functions.dynamics(x + step, still) - functions.dynamics(x - step, still)) / (2.0 * STEP)
        for step in steps
    ]
    return np.array(columns).reshape(x.size, x.size).T


def velocity_jacobian(functions: Functions, x: FloatArray, v: FloatArray) -> FloatArray:
    """(N D, N D) by central differences; players of order 1 have no velocity, and columns of zeros."""
    steps = STEP * np.eye(x.size).reshape(-1, *x.shape)
    columns = [
        (functions.dynamics(x, v + step) - functions.dynamics(x, v - step)) / (2.0 * STEP) for step in steps
    ]
    return np.array(columns).reshape(x.size, x.size).T


def equilibrium_of(game: Path) -> FloatArray:
    found = judge_equilibrium(game)
    assert found is not None
    return found.x_star


def check_samples(bounds: GameBounds, functions: Functions, seed: int) -> None:
    random = np.random.default_rng(seed)
    lower, upper = bounds.box.lower, bounds.box.upper
    N, D = lower.shape
    for point in range(POINTS):
        share = random.random((N, D))
        if point % 3 == 0:
            share = np.round(share)  # corners
        x = lower + share * (upper - lower)
        h = gradient_jacobian(functions, x)
        near = 1e-6 * (1.0 + np.abs(h).max())
        assert np.linalg.eigvalsh(0.5 * (h + h.T))[0] >= bounds.monotonicity - near
        own = np.linalg.norm(h.reshape(N, D, N * D), 2, axis=(1, 2))
        assert np.all(own <= bounds.gradients.lipschitz + near)
        assert np.all(np.abs(h - bounds.gradients.middle) <= bounds.gradients.radius + near)
        change = dynamics_jacobian(functions, x)
        near = 1e-6 * (1.0 + np.abs(change).max())
        assert np.all(
            np.linalg.norm(change.reshape(N, D, N * D), 2, axis=(1, 2)) <= bounds.dynamics.lipschitz + near
        )
        v = bounds.speed * np.where(
            point % 4 == 0, random.choice([-1.0, 1.0], (N, D)), random.uniform(-1, 1, (N, D))
        )
        moving = velocity_jacobian(functions, x, v).reshape(N, D, N * D)
        near = 1e-6 * (1.0 + np.abs(moving).max())
        assert np.all(np.linalg.norm(moving, 2, axis=(1, 2)) <= bounds.velocities.lipschitz + near)
        if np.isfinite(bounds.dynamics_size).all():
            assert np.all(np.abs(functions.dynamics(x, np.zeros_like(x))) <= bounds.dynamics_size + 1e-12)
    times = np.concatenate([np.linspace(0.0, 50.0, 500), [1e4]])
    largest = np.max([np.abs(functions.disturbances(float(t))) for t in times], axis=0)
    assert np.all(largest <= bounds.disturbance_size)
    assert bounds.sampled_monotonicity >= bounds.monotonicity
    assert np.all(bounds.gradients.sampled <= bounds.gradients.lipschitz)
    assert np.all(bounds.dynamics.sampled <= bounds.dynamics.lipschitz)
    assert np.all(bounds.velocities.sampled <= bounds.velocities.lipschitz)


@pytest.mark.parametrize("name", sorted(set(BY_HAND) - {"two_hundred_households"}))
def test_bounds_of_the_example_games_hold_at_samples(name: str) -> None:
    x_star = equilibrium_of(GAMES / f"{name}.toml")
    distance = 0.02 if name == "rate_allocation" else 0.15  # whose logarithms end at 0
    bounds = game_bounds(GAMES / f"{name}.toml", box_around(x_star, distance), x_star, speed=0.7)
    assert bounds.monotone
    assert bounds.open == ()
    assert bounds.reach == pytest.approx(distance)
    # proofs are close to samples
    assert bounds.monotonicity >= 0.7 * bounds.sampled_monotonicity
    for found in (bounds.gradients, bounds.dynamics, bounds.velocities):
        assert np.all(found.lipschitz <= 1.05 * found.sampled)
    check_samples(bounds, BY_HAND[name](), 5)


def test_what_a_part_proves_its_halves_do_not_lose() -> None:
    game = GAMES / "source_seeking.toml"
    x_star = equilibrium_of(game)
    bounds = game_bounds(game, box_around(x_star, 0.6), x_star)
    assert bounds.monotonicity > 0.98 * bounds.sampled_monotonicity


@pytest.mark.parametrize(
    ("text", "distance", "share"),
    [(fewer_households(50), 0.5, 0.98), (seekers(21)[0], 1.5, 0.8)],
    ids=["households", "seekers"],
)
def test_bounds_of_games_too_large_to_cut_are_close_to_samples(
    text: str, distance: float, share: float, tmp_path: Path
) -> None:
    game = tmp_path / "game.toml"
    game.write_text(text, encoding="utf-8")
    x_star = equilibrium_of(game)
    assert x_star.size > 40
    bounds = game_bounds(game, box_around(x_star, distance), x_star)
    assert bounds.monotonicity > share * bounds.sampled_monotonicity > 0.0
    for found in (bounds.gradients, bounds.dynamics):
        assert found.lipschitz.max() <= 1.06 * found.sampled.max()


@pytest.mark.parametrize("seed", range(10))
def test_bounds_of_random_games_hold_at_samples(seed: int, tmp_path: Path) -> None:
    made = random_game(seed, 2 + seed % 3, 1 + seed % 2)
    (tmp_path / "game.toml").write_text(made.text, encoding="utf-8")
    x_star = equilibrium_of(tmp_path / "game.toml")
    bounds = game_bounds(tmp_path / "game.toml", box_around(x_star, 0.4), x_star)
    assert np.isfinite(bounds.gradients.lipschitz).all()
    # proofs are close to samples on boxes of this size
    assert np.all(bounds.gradients.lipschitz <= 1.05 * bounds.gradients.sampled)
    assert bounds.monotonicity >= bounds.sampled_monotonicity - 0.1 * bounds.gradients.sampled.max()
    check_samples(bounds, made.functions, seed)


def as_expressions(name: str) -> str:
    """A game of coefficients as text of the same game with expressions."""
    text = (GAMES / f"{name}.toml").read_text(encoding="utf-8")
    return re.sub(r"cost = \{ ", 'cost = { expression = "0 * x[1,1]", ', text)


@pytest.mark.parametrize("name", ["five_vehicles", "cournot_two_markets", "opinion_formation"])
def test_of_quadratic_games_they_are_the_exact_constants(name: str, tmp_path: Path) -> None:
    game = tmp_path / "game.toml"
    game.write_text(as_expressions(name), encoding="utf-8")
    exact = read_game(name)
    c = loop_constants(exact.parameters)
    x_star = equilibrium_of(GAMES / f"{name}.toml")
    bounds = game_bounds(game, box_around(x_star, 3.0), x_star)
    found = loop_constants(replace(exact.parameters, bounds=bounds))
    assert bounds.open == ()
    assert found.monotonicity == pytest.approx(c.monotonicity, rel=1e-10)
    assert bounds.sampled_monotonicity == pytest.approx(c.monotonicity, rel=1e-10)
    np.testing.assert_allclose(found.lipschitz, c.lipschitz, rtol=1e-10)
    for figure in (
        "pseudo_gradient_norm",
        "first_rows_norm",
        "first_lipschitz",
        "hessian_norm",
        "exact_b",
        "estimate_pull",
    ):
        assert getattr(found, figure) == pytest.approx(getattr(c, figure), rel=1e-9), figure
    for p in (0.01, 0.3, 4.0):
        assert found.estimate_coupling(p) == pytest.approx(c.estimate_coupling(p), rel=1e-9)
    linear = dynamics_constants(exact.parameters, 0.0, 0.0)
    if not np.any(exact.parameters.dynamics_square):
        over_box = dynamics_constants(replace(exact.parameters, bounds=bounds), 3.0, 3.0)
        np.testing.assert_allclose(over_box.lipschitz, linear.lipschitz, rtol=1e-10)
        assert over_box.first_tracking == pytest.approx(linear.first_tracking, rel=1e-9)
    beyond = dynamics_constants(replace(exact.parameters, bounds=bounds), 3.1, 1.0)
    assert np.isinf(beyond.lipschitz).all()


SECOND_ORDER = (
    head(k3=400.0, epsilon=0.1).replace("k4 = 20.0", "k4 = 900.0")
    + """[parameters]
slope = 0.3
[defaults]
order = 2
x0 = 0.4
z0 = "x0"
y0 = "x0"
"""
)
DRIVERS = (
    SECOND_ORDER
    + """\
cost = { expression = "x[i]^2 + 0.1 * cosh(x[i]) - 0.2 * x[i] * exp(-slope * sum(x[j] for j in 1..N))" }
dynamics = { expression = "0.2 * sin(x[i]) - %s" }
disturbance = { expression = "0.5 * square(t, 3)" }
[[player]]
name = "a"
order = 1
dynamics = { expression = "0.3 * tanh(v[2]) * cos(x[3])" }
[[player]]
name = "b"
x0 = -0.2
[[player]]
name = "c"
"""
)


def test_dynamics_that_depend_on_velocities_are_judged_up_to_a_speed(tmp_path: Path) -> None:
    game = tmp_path / "drivers.toml"
    game.write_text(DRIVERS % "0.3 * v[i] * abs(v[i])", encoding="utf-8")
    fmu = build_fmu(game, game.with_suffix(".fmu"))
    slow, fast = analyse(fmu, box=1.0, speed=1.0), analyse(fmu, box=1.0, speed=2.0)
    for found, speed in ((slow, 1.0), (fast, 2.0)):
        assert found.value("box", "speed") == speed
        assert found.value("box", "nu_1") == pytest.approx(0.3, rel=0.01)
        assert found.value("box", "nu_2") == pytest.approx(0.6 * speed, rel=0.01)
        assert float(found.value("box", "nu_2 sampled")) <= float(found.value("box", "nu_2"))
        assert found.bounds is not None
        assert found.bounds.dynamics_size.max() == pytest.approx(
            0.2 * np.sin(1.0 + found.bounds.x_star.max()), rel=0.2
        )
        assert f"max nu_i = {0.6 * speed:.1f}" in " ".join(each.figures for each in found.hypotheses)
    for threshold in ("k4*", "sharper k4*"):
        assert float(slow.value("theorem 1", threshold)) < float(fast.value("theorem 1", threshold))
    found = analyse(fmu)
    design = found.demonstrations[0]
    assert design.complete
    gains = {name: value for name, value in vars(design.design.gains).items() if name != "W_max"}
    settled = design.design.settling_time
    run = mog.run(fmu, start_values=gains, stop_time=2.0 * settled, step=0.01, tolerance=1e-8)
    assert run.nash_error[run.time >= settled].max() <= 1.01 * design.design.radius
    assert np.abs(run.v[:, 1:]).max() <= float(found.value("box", "speed"))
    with pytest.raises(mog.GameError, match="speed = -1 is not positive"):
        analyse(fmu, speed=-1.0)


def test_friction_with_a_sign_is_not_proved(tmp_path: Path) -> None:
    game = tmp_path / "drivers.toml"
    game.write_text(DRIVERS % "0.3 * sign(v[i])", encoding="utf-8")
    told = " ".join(analyse(game, box=1.0).verdicts)
    assert 'the dynamics of player 2 may switch in the box: "sign(v[i])"' in told
    assert "Theorem 1 is not judged" in told


SELLERS = (
    SECOND_ORDER
    + """\
cost = { expression = "x[i]^2 + %s - 0.2 * x[i] * exp(-slope * sum(x[j] for j in 1..N))" }
dynamics = { expression = "0.2 * sin(x[i])" }
disturbance = { expression = "0.5 * square(t, 3) + 0.2 * cos(2 * t)" }
[[player]]
name = "a"
order = 1
[[player]]
name = "b"
x0 = -0.2
[[player]]
name = "c"
"""
)


@pytest.fixture(scope="module")
def sellers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sellers") / "sellers.toml"
    path.write_text(SELLERS % "0.1 * cosh(x[i])", encoding="utf-8")
    return build_fmu(path, path.with_suffix(".fmu"))


def test_the_rate_that_is_proved_is_kept_by_a_run(sellers: Path) -> None:
    """V = |xbar - x*|^2 / 2 + ... falls at K_0 at least; without perturbation, from within the set."""
    found = analyse(sellers)
    rate, level = found.value("theorem 2", "sharper rate"), found.value("theorem 2", "level")
    assert float(found.value("theorem 2", "V(0)")) <= float(level)
    assert float(rate) > 0.05
    off = {"robust": False, "perturbed": False}
    run = mog.run(sellers, start_values=off, stop_time=8.0, step=0.05, tolerance=1e-10)
    settled = run.nash_error[run.time > 4.0]
    times = run.time[run.time > 4.0]
    assert -np.polyfit(times, np.log(settled), 1)[0] >= float(rate)
    game = game_of_model(mog.read_model(sellers))
    assert found.bounds is not None
    c = loop_constants(replace(game.parameters, x_star=found.bounds.x_star, bounds=found.bounds))
    weights = best_certificate(c, NO_DYNAMICS, game.gains, tracking=False).weights
    largest = np.sqrt(2.0 * float(found.value("theorem 2", "V(0)")))
    # |xbar - x*| <= sqrt(2 V(0)) exp(-K_0 t / 2) + x_f's lag; x of order 2 has no lag
    assert weights.velocities > 0.0
    deviation = np.linalg.norm((run.x - found.bounds.x_star)[:, 1:], axis=(1, 2))
    assert np.all(deviation <= largest * np.exp(-float(rate) * run.time) * (1.0 + 1e-6) + 1e-8)


def test_designed_gains_keep_what_they_guarantee(sellers: Path) -> None:
    found = analyse(sellers, radius=0.1)
    design = found.demonstrations[0]
    assert design.complete
    gains = {name: value for name, value in vars(design.design.gains).items() if name != "W_max"}
    settled = design.design.settling_time
    run = mog.run(sellers, start_values=gains, stop_time=2.0 * settled, step=0.01, tolerance=1e-8)
    assert run.nash_error[run.time >= settled].max() <= 1.01 * design.design.radius
    assert design.design.radius == pytest.approx(0.1, rel=1e-6)


def test_the_box_can_be_chosen_and_parameters_changed(sellers: Path) -> None:
    near, far = analyse(sellers, box=0.3), analyse(sellers, box=1.5)
    assert float(near.value("box", "m")) > float(far.value("box", "m"))
    assert float(near.value("box", "l_1")) <= float(far.value("box", "l_1"))
    assert "where every action is within 0.3 of x*: m = " in " ".join(near.verdicts)
    steeper = analyse(sellers, box=0.3, changes={"slope": 1.0})
    assert float(steeper.value("box", "m")) != float(near.value("box", "m"))
    assert steeper.bounds is not None
    assert near.to_dict()["box"]["monotonicity"] == near.value("box", "m")
    shown = CliRunner(env={"NO_COLOR": "1"}).invoke(
        app, ["analyse", str(sellers), "--box", "0.3", "--tables"]
    )
    assert shown.exit_code == 0
    assert "strong monotonicity there (Assumption 3), proved" in shown.stdout
    with pytest.raises(mog.GameError, match="box = -1 is not positive"):
        analyse(sellers, box=-1.0)
    with pytest.raises(mog.GameError, match="whose constants need neither box nor speed"):
        analyse("five_vehicles", box=1.0)
    with pytest.raises(mog.GameError, match="no dynamics of this game depend on velocities"):
        analyse("source_seeking", box=0.5, speed=1.0)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("0.1 * abs(x[i] - 0.3)", r'the cost of player 1 may switch in the box: "abs\(x\[i\] - 0.3\)"'),
        ("0.1 * log(0.6 + x[i])", "the cost of player 1 may have points of the box without a value"),
    ],
)
def test_what_is_open_is_named(more: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    path.write_text(SELLERS % more, encoding="utf-8")
    found = analyse(path, box=1.0)
    assert re.search(told, " ".join(found.verdicts))
    assert not any("certificate proves" in verdict for verdict in found.verdicts)
    x_star = equilibrium_of(path)
    parameters = game_parameters(mog.read_model(build_fmu(path, tmp_path / "game.fmu")))
    assert parameters.bounds is None
    assert game_bounds(path, box_around(x_star, 0.1), x_star).monotone
    # the default box is one within which it is proved
    assert float(analyse(path).value("box", "m")) > 0.0


def test_unknown_dynamics_without_a_slope_at_the_equilibrium_leave_the_unperturbed_loop_as_it_is(
    tmp_path: Path,
) -> None:
    """Its matrix does not contain them; perturbed, there is none."""
    players = "".join(
        f'[[player]]\nname = "{name}"\norder = {order}\nx0 = 0.6\n'
        "cost = { quadratic = 1.0, linear = -2.0 }\n"
        for name, order in (("a", 1), ("b", 2), ("c", 1))
    )
    steep = tmp_path / "steep.toml"
    steep.write_text(
        head() + '[defaults]\ndynamics = { expression = "sign(x[i] - 1) * sqrt(abs(x[i] - 1))" }\n' + players,
        encoding="utf-8",
    )
    plain = tmp_path / "plain.toml"
    plain.write_text(head() + players, encoding="utf-8")
    found = analyse(steep)
    expected = analyse(plain, simulation=False).exact
    assert expected is not None
    assert float(found.value("local", "slowest rate")) == pytest.approx(-expected.abscissa, rel=1e-9)
    assert "the dynamics of player 1 may have points of the box without a value or a derivative" in " ".join(
        found.verdicts
    )
    states = ("x[1,1]", "y[1,1,1]")
    at_rest = {f"{stem}[{i},1]": 1.0 for i, stem in ((1, "x0"), (2, "x0"), (3, "x0"))}
    with mog.Simulator(steep) as simulator:
        assert np.isfinite(simulator.jacobian(states, {**at_rest, "perturbed": False})).all()
        with pytest.raises(mog.SimulationError, match="has none where it is taken"):
            simulator.jacobian(states, at_rest)


def test_a_directed_graph_is_told_as_in_games_of_coefficients(tmp_path: Path) -> None:
    path = tmp_path / "game.toml"
    directed = (SELLERS % "0.0").replace("[graph]\n", "[graph]\ndirected = true\n")
    path.write_text(directed, encoding="utf-8")
    found = analyse(path, box=0.3)
    (graph,) = [each for each in found.hypotheses if each.name == "Assumption 2: undirected connected graph"]
    assert graph.holds is False
    assert re.fullmatch(
        r"lambda_min\(the symmetric part of L \(x\) I \+ A_0\) = \S+; directed, strongly connected",
        graph.figures,
    )
