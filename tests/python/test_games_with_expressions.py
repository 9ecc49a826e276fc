"""What commands and functions say of games with expressions: refused, judged or shown, never zero."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root
from typer.testing import CliRunner, Result

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.game.gains import choose_gains
from mixed_order_game.game.parameters import GameParameters, game_parameters
from mixed_order_game.results.unknown_term import recorded_for_unknown_term, unknown_term
from mixed_order_game.studies.claims.unperturbed_loop import slowest_rate_seen
from mixed_order_game.studies.claims.verdict import Verdict
from mixed_order_game.studies.tune import tune
from mixed_order_game.studies.validate import validate
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.constants import dynamics_constants, loop_constants
from mixed_order_game.theory.game import read_game
from mixed_order_game.theory.linearized import linearized_loop
from mixed_order_game.theory.spectrum import (
    gradient_map,
    linear_loop,
    monotonicity_constant,
    nash_equilibrium,
    spectral_abscissa,
)
from tests.three_players import head

HEAD = head(delta=12.0, epsilon=0.1, weight=1.0)
GAME = (
    HEAD
    + """
[parameters]
price = { value = 12.0, min = 0.0, max = 100.0, description = "price at no demand" }
h = [5.0, 7.0, 6.0]
R = { value = [[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]], fixed = true }
[defaults]
cost = { expression = "(x[i] - h[i])^2 - price * x[i] * exp(-0.1 * sum(x[j] for j in 1..N))" }
y0 = "x0"
[[player]]
name = "a"
order = 1
x0 = 1.0
z0 = "x0"
[[player]]
name = "b"
order = 2
x0 = 1.5
dynamics = { linear = [[1, 0.3]], expression = "sin(x[i]) * x[3] - 0.5 * v[i] * tanh(v[i] / 0.1)" }
disturbance = { amplitude = 0.2, frequency = 3.0, expression = "0.3 * cos(2 * t) + exp(-t)" }
[[player]]
name = "c"
order = 2
x0 = 0.5
dynamics = { expression = "sum(R[i,j] * x[j] for j in 1..N) / (1 + x[i]^2) - v[2] * log(2 + v[i]^2)" }
"""
)

COST = "player 1's cost has an expression"


def command(*arguments: object) -> Result:
    environment = {"COLUMNS": "200", "NO_COLOR": "1"}
    return CliRunner(env=environment).invoke(app, [str(each) for each in arguments])


@pytest.fixture(scope="module")
def game(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("expressions") / "sellers.toml"
    path.write_text(GAME, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def fmu(game: Path) -> Path:
    return build_fmu(game, game.with_suffix(".fmu"))


STATES = [*("x[1,1]", "x[2,1]", "x[3,1]"), *("z[1,1]", "v[2,1]", "v[3,1]")]
STATES += [f"y[{i},{j},1]" for i in (1, 2, 3) for j in (1, 2, 3)]


def unperturbed_rates(state: NDArray[np.float64], price: float, k3: float) -> NDArray[np.float64]:
    """Rates of (x | z_1 | v_2, v_3 | y) by the paper's equations and the costs' derivatives, by hand."""
    x, z, v, y = state[:3], state[3], state[4:6], state[6:].reshape(3, 3)
    own = np.diag(y)
    demand = np.exp(-0.1 * y.sum(axis=1))
    gradient = 2.0 * (own - np.array([5.0, 7.0, 6.0])) - price * demand * (1.0 - 0.1 * own)
    shared = np.array([z, x[1], x[2]])
    a = np.ones((3, 3)) - np.eye(3)
    y_rate = [
        [-k3 * (a[i] @ (y[i, j] - y[:, j]) + a[i, j] * (y[i, j] - shared[j])) for j in range(3)]
        for i in range(3)
    ]
    first = [-10.0 * (x[0] - z), v[0], v[1], -gradient[0]]
    return np.concatenate([first, -20.0 * v - 20.0 * gradient[1:], np.ravel(y_rate)])


def linearization_by_hand(price: float, k3: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x* by a root of the gradients and M by central differences at it."""

    def gradients(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return unperturbed_rates(np.concatenate([x, x[:1], [0.0, 0.0], np.tile(x, 3)]), price, k3)[3:6]

    x = root(gradients, np.full(3, 5.0), tol=1e-14).x
    rest = np.concatenate([x, x[:1], [0.0, 0.0], np.tile(x, 3)])
    steps = 1e-5 * np.eye(len(rest))
    columns = [
        (unperturbed_rates(rest + step, price, k3) - unperturbed_rates(rest - step, price, k3)) / 2e-5
        for step in steps
    ]
    return x, np.array(columns).T


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same game, of which the FMU shows no estimates."""
    path = tmp_path_factory.mktemp("hidden") / "sellers.toml"
    path.write_text(GAME.replace("dimension = 1", 'expose = "outputs"\ndimension = 1'), encoding="utf-8")
    return build_fmu(path, path.with_suffix(".fmu"))


@pytest.mark.parametrize("shown", [True, False])
@pytest.mark.parametrize("changes", [{}, {"price": 40.0, "k3": 2.0, "a": 1.0}])
def test_the_loop_is_linearized_as_by_hand(
    changes: dict[str, float], shown: bool, fmu: Path, hidden: Path
) -> None:
    x_star, by_hand = linearization_by_hand(changes.get("price", 12.0), changes.get("k3", 50.0))
    with mog.Simulator(fmu if shown else hidden) as simulator:
        assert bool(simulator.model.indexed("y")) is shown
        loop = linearized_loop(simulator, changes)
    np.testing.assert_allclose(loop.x_star.ravel(), x_star, rtol=1e-10)
    np.testing.assert_allclose(loop.matrix, by_hand, atol=1e-7)
    assert loop.abscissa == pytest.approx(np.linalg.eigvals(by_hand).real.max(), rel=1e-6)
    np.testing.assert_allclose(loop.jacobian[0], -by_hand[3, 6:9], atol=1e-7)
    np.testing.assert_allclose(loop.jacobian[2], -by_hand[5, 12:15] / 20.0, atol=1e-7)


@pytest.mark.parametrize("name", ["five_vehicles", "opinion_formation"])
def test_of_a_quadratic_game_it_is_the_loop_itself(name: str) -> None:
    with mog.Simulator(name) as simulator:
        parameters = game_parameters(simulator.model)
        loop = linearized_loop(simulator)
    alike = np.eye(parameters.dimension)
    np.testing.assert_allclose(loop.x_star, nash_equilibrium(parameters), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(loop.jacobian, np.kron(gradient_map(parameters), alike), atol=1e-9)
    assert loop.abscissa == pytest.approx(spectral_abscissa(linear_loop(parameters)), rel=1e-6)


def test_the_analysis_is_of_the_loop_near_the_equilibrium(game: Path, fmu: Path) -> None:
    found = analyse(game)
    _, by_hand = linearization_by_hand(12.0, 50.0)
    rate = -np.linalg.eigvals(by_hand).real.max()
    assert found.value("local", "slowest rate") == pytest.approx(rate, rel=1e-6)
    assert found.value("local", "stable") is True
    assert found.verdicts[0].endswith("and holds near x* alone.")
    assert analyse(fmu, changes={"k3": 0.01}).value("local", "stable") is False
    shown = command("analyse", game, "--json")
    assert json.loads(shown.stdout)["constants"] is None
    assert "near x*" in command("analyse", game, "--tables").stdout
    refused = command("analyse", game, "--no-square")
    assert refused.exit_code == 1
    assert f"only coefficients have a square term to remove; {COST}" in refused.stderr
    with pytest.raises(mog.GameError, match="the analysis reads costs, dynamics and disturbances as coeff"):
        read_game(fmu)


def test_near_the_equilibrium_a_run_decays_at_that_rate(fmu: Path) -> None:
    with mog.Simulator(fmu) as simulator:
        loop = linearized_loop(simulator)
        eigenvalues, vectors = np.linalg.eig(loop.matrix)
        slowest = vectors[:, np.argmax(eigenvalues.real)].real
        near: dict[str, float] = {}
        for name, part in zip(STATES, 1e-3 * slowest / np.abs(slowest).max(), strict=True):
            rest = 0.0 if name.startswith("v") else loop.x_star[int(name.split(",")[-2][-1]) - 1, 0]
            near[name.replace("[", "0[")] = rest + part
        off = {**near, "robust": False, "perturbed": False}
        run = simulator.run(start_values=off, stop_time=2.0, tolerance=1e-12)
    slope = np.polyfit(run.time, np.log(run.nash_error), 1)[0]
    assert slope == pytest.approx(loop.abscissa, rel=1e-3)


@pytest.mark.parametrize(
    "function",
    [linear_loop, monotonicity_constant, nash_equilibrium, loop_constants, dynamics_constants, choose_gains],
)
def test_what_reads_coefficients_refuses(function: object, fmu: Path) -> None:
    parameters = game_parameters(mog.read_model(fmu))
    assert callable(function)
    with pytest.raises(
        mog.GameError, match=r"as coefficients; player (1's cost has|2's dynamics have) an expression"
    ):
        function(parameters)
    of_dynamics = replace(parameters, expressions={"dynamics": (2, 3)})
    with pytest.raises(mog.GameError, match="as coefficients; player 2's dynamics have an expression"):
        of_dynamics.unknown_dynamics(of_dynamics.x0)


def test_tune_searches_on_the_loop_near_the_equilibrium(fmu: Path) -> None:
    found = tune(fmu, 1.5, start_values={"perturbed": False}, seed=2)
    assert found.met
    assert found.settling_time <= 1.5
    # the rate told is that of the linearization by differences, with the gains that were found
    with mog.Simulator(fmu) as simulator:
        loop = linearized_loop(simulator, dict(found.gains))
    assert found.slowest_rate == pytest.approx(-loop.abscissa, rel=1e-6)


def test_the_unknown_term_is_that_of_the_formulas_by_hand(fmu: Path) -> None:
    model = mog.read_model(fmu)
    rates = recorded_for_unknown_term(model)
    assert rates == ["der(x[1,1])", "der(v[2,1])", "der(v[3,1])"]
    result = mog.run(fmu, stop_time=2.0, step=0.1, outputs=["x", "v", "z", "u", "y", "W", *rates])
    found = unknown_term(game_parameters(model), result)[:, :, 0]
    x, v = result.x[:, :, 0], result.v[:, :, 0]
    t = result.time
    by_hand = np.zeros_like(x)
    by_hand[:, 1] = (
        0.3 * x[:, 0] + np.sin(x[:, 1]) * x[:, 2] - 0.5 * v[:, 1] * np.tanh(v[:, 1] / 0.1)
        + 0.2 * np.sin(3.0 * t) + 0.3 * np.cos(2.0 * t) + np.exp(-t)
    )  # fmt: skip
    by_hand[:, 2] = x[:, 1] / (1.0 + x[:, 2] ** 2) - v[:, 1] * np.log(2.0 + v[:, 2] ** 2)
    assert np.abs(found - by_hand).max() < 1e-9 * np.abs(by_hand).max()


def test_validate_judges_what_it_can(hidden: Path) -> None:
    found = validate(hidden, limit=100.0)
    assert found.model.path == hidden
    verdicts = {claim.name: claim for claim in found.claims}
    assert verdicts["nash_equilibrium"].verdict is Verdict.HOLDS
    assert verdicts["nash_equilibrium"].statement == "x* is a Nash equilibrium, if only a local one"
    for name in ("theorem_2_stability", "theorem_2_convergence"):
        assert verdicts[name].verdict is Verdict.NOT_COVERED
        assert "player 1's cost has an expression" in verdicts[name].reason
    assert "it is exponentially stable near x*" in verdicts["theorem_2_stability"].reason
    assert verdicts["lemma_3_weights"].verdict is Verdict.HOLDS
    assert "No bound explains the neighbourhood: player 1's cost has an expression" in found.notes[0]
    for name in ("actions", "velocities", "estimates"):
        assert verdicts[f"practical_convergence_{name}"].verdict is Verdict.HOLDS
    assert any("player 2's disturbance has an expression" in note for note in found.notes)


QUADRATIC = """
[defaults]
order = 2
x0 = 4.0
cost = { linear = -1.0, %s }
[[player]]
name = "a"
order = 1
[[player]]
name = "b"
x0 = -1.0
[[player]]
name = "c"
"""


def test_the_rate_seen_is_near_the_spectrum_of_the_same_game_in_coefficients(tmp_path: Path) -> None:
    parameters: list[GameParameters] = []
    files = []
    for name, cost in (("coefficients", "quadratic = 0.7"), ("expression", 'expression = "0.7 * x[i]^2"')):
        path = tmp_path / f"{name}.toml"
        path.write_text(HEAD + QUADRATIC % cost, encoding="utf-8")
        files.append(build_fmu(path, path.with_suffix(".fmu")))
        parameters.append(game_parameters(mog.read_model(files[-1])))
    eigenvalues = np.linalg.eigvals(linear_loop(parameters[0]))
    off = {"robust": False, "perturbed": False}
    seen = slowest_rate_seen(mog.run(files[1], start_values=off, stop_time=20.0, tolerance=1e-9))
    assert seen == pytest.approx(-eigenvalues.real.max(), rel=0.1)


SKEW = """
[parameters]
A = { value = [[2.0, 1.5, -1.0], [-1.2, 2.5, 0.8], [0.9, -0.7, 3.0]], fixed = true }
[defaults]
order = 2
x0 = [1.0, -1.0]
cost = { expression = '''
  sum(0.5 * A[i,i] * x[i,k]^2 + x[i,k] * (sum(A[i,j] * x[j,k] for j in 1..N if j != i) + 1) for k in 1..D)
  + 0.3 * x[i,1] * x[mod(i, N) + 1,2]''' }
[[player]]
name = "a"
[[player]]
name = "b"
order = 1
[[player]]
name = "c"
"""


def test_a_game_of_affine_gradients_is_judged_as_one_of_coefficients(tmp_path: Path) -> None:
    """Couplings that coefficients cannot express, between coordinates: the loop is linear all the same."""
    path = tmp_path / "skew.toml"
    path.write_text(HEAD.replace("dimension = 1", "dimension = 2") + SKEW, encoding="utf-8")
    A = np.array([[2.0, 1.5, -1.0], [-1.2, 2.5, 0.8], [0.9, -0.7, 3.0]])
    across = np.zeros((6, 6))
    across[[0, 2, 4], [3, 5, 1]] = 0.3
    h = np.kron(A, np.eye(2)) + across
    x_star = np.asarray(np.linalg.solve(h, -np.ones(6)).reshape(3, 2), dtype=np.float64)
    found = validate(path, limit=20.0)
    verdicts = {claim.name: claim for claim in found.claims}
    assert verdicts["nash_equilibrium"].statement == "There is a unique Nash equilibrium x*"
    assert verdicts["nash_equilibrium"].figures["m"] == pytest.approx(np.linalg.eigvalsh(0.5 * (h + h.T))[0])
    for name in ("theorem_2_stability", "theorem_2_convergence"):
        assert verdicts[name].verdict is Verdict.HOLDS
    game = replace(game_parameters(found.model), x_star=x_star, jacobian=h)
    expected = spectral_abscissa(linear_loop(game))
    assert verdicts["theorem_2_stability"].figures["abscissa"] == pytest.approx(expected, rel=1e-7)
    analysis = analyse(path)
    assert analysis.verdicts[0] == (
        "Expressions in costs: what follows is of the unperturbed loop, which is linear."
    )
    assert not any("near x*" in verdict for verdict in analysis.verdicts)


STARTS = """
[defaults]
order = 2
x0 = [1.0, -2.0]
v0 = [0.5, 0.25]
z0 = 3.0
y0 = %s
cost = { quadratic = 2.0, linear = [1.0, 2.0] }
dynamics = { linear = [[1, 0.5]], square = [[2, [0.1, 0.2]]] }
disturbance = { amplitude = 1.5, bias = [0.0, -1.0] }
[[player]]
name = "a"
order = 1
cost = { quadratic = 1.0 }
[[player]]
name = "b"
x0 = 7.0
dynamics = {}
[[player]]
name = "c"
y0 = [[1.0, 2.0], 3.0, 4.0, 5.0]
disturbance = { amplitude = 0.5 }
[[player]]
name = "d"
order = 1
z0 = "x0"
"""


@pytest.mark.parametrize("y0", ['"x0"', "[5.0, 6.0]", "2.5", "[1.0, 2.0, 3.0, [4.0, 5.0]]"])
@pytest.mark.parametrize("expose", ["all", "outputs"])
def test_defaults_are_read_as_the_fmu_reads_them(y0: str, expose: str, tmp_path: Path) -> None:
    head = HEAD.replace("dimension = 1", f'dimension = 2\nexpose = "{expose}"').replace("[3, 1]", "[3, 4]")
    path = tmp_path / "starts.toml"
    path.write_text(head + STARTS % y0, encoding="utf-8")
    model = mog.read_model(build_fmu(path, path.with_suffix(".fmu")))
    of_fmu, of_file = game_parameters(model), read_game(path).parameters
    for each in fields(GameParameters):
        if each.name not in ("expressions", "x_star"):
            assert np.array_equal(getattr(of_fmu, each.name), getattr(of_file, each.name)), each.name
    assert np.array_equal(of_file.cost_quadratic, [1.0, 2.0, 2.0, 2.0])
    assert np.array_equal(of_file.cost_linear[0], [0.0, 0.0])  # the whole key is replaced


def test_defaults_of_coefficients_are_analysed(tmp_path: Path) -> None:
    path = tmp_path / "defaults.toml"
    path.write_text(HEAD + QUADRATIC % "quadratic = 0.7", encoding="utf-8")
    found = analyse(path, simulation=False, square=False)
    assert found.constants is not None
    assert found.constants.monotonicity == pytest.approx(1.4)


def test_info_shows_parameters_and_expressions(game: Path) -> None:
    shown = " ".join(command("info", game).stdout.split())
    assert "expressions costs of all players" in shown
    assert "expressions dynamics of players 2, 3" in shown
    assert "price 12 0 to 100 price at no demand" in shown
    assert "R 3 x 3, fixed" in shown
    data = json.loads(command("info", game, "--json").stdout)
    assert data["expressions"] == {"cost": [1, 2, 3], "dynamics": [2, 3], "disturbance": [2]}
    assert data["named_parameters"][0]["max"] == 100.0
    assert data["named_parameters"][1]["value"] == [5.0, 7.0, 6.0]


def test_the_report_shows_the_expression_and_says_what_is_missing(fmu: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    done = command("report", fmu, "--no-claims", "--output", page)
    assert done.exit_code == 0, done.output
    text = page.read_text(encoding="utf-8")
    assert "<math" in text
    assert "<mi>exp</mi>" in text
    assert "for near x* alone: player 1&#39;s cost has an expression" in text
