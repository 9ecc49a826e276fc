"""Designs for Theorem 1, the network's fit and the whole analysis, with runs of the FMU."""

import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console
from typer.testing import CliRunner

from mixed_order_game import build_fmu
from mixed_order_game.cli.analysis_tables import print_analysis
from mixed_order_game.cli.app import app
from mixed_order_game.errors import GameError, SimulationError, VariableError
from mixed_order_game.game.parts import toml_of_game
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.design import Design, paper_design, sharper_design
from mixed_order_game.theory.domain import initial_errors
from mixed_order_game.theory.game import AnalysedGame, read_game, without_square
from mixed_order_game.theory.hypotheses import design_hypotheses, largest_representable_radius, robust_term
from mixed_order_game.theory.network_fit import (
    activations,
    ball_points,
    least_squares_fit,
    mirror_bound,
    trajectory_fit,
)
from mixed_order_game.theory.simulation import simulate
from mixed_order_game.theory.spectrum import nash_equilibrium
from tests.conftest import GAMES, FmuOf
from tests.oracle import game as oracle
from tests.oracle import paper_equations as paper

FIVE_VEHICLES = Path(__file__).resolve().parents[2] / "modelDescription/games/five_vehicles.toml"

FloatArray = NDArray[np.float64]


@pytest.fixture(scope="module")
def five() -> AnalysedGame:
    return read_game(FIVE_VEHICLES)


@pytest.fixture(scope="module")
def linear(five: AnalysedGame, tmp_path_factory: pytest.TempPathFactory) -> AnalysedGame:
    file = tmp_path_factory.mktemp("linear") / "game.toml"
    file.write_text(toml_of_game(without_square(five.tables)), encoding="utf-8")
    return read_game(file)


@pytest.fixture(scope="module")
def linear_fmu(linear: AnalysedGame) -> Path:
    return build_fmu(linear.path, linear.path.with_suffix(".fmu"))


def check_run(design: Design, game: AnalysedGame, fmu: Path) -> None:
    """The run stays in the set, V falls as proved, and the radius is kept from the settling time on."""
    seen = simulate(fmu, game, stop_time=2.0 * design.settling_time, gains=design.gains)
    certificate = design.certificate
    ultimate = certificate.ultimate_level(design.gains, optimal_weight_norm=0.0)
    assert seen.errors is not None
    level = seen.errors.level(certificate.weights)
    proved = design.domain.level * np.exp(-certificate.rate * seen.time) + ultimate
    assert np.all(level <= proved * (1.0 + 1e-6))
    assert seen.errors.largest_estimate.max() <= design.domain.estimate_radius
    assert seen.error.max() <= design.domain.action_radius
    assert seen.radius(design.settling_time) <= 1.01 * design.radius
    assert seen.root_mean_square(design.settling_time) <= design.mean_radius
    assert seen.largest_weight_norm2 <= game.gains.W_max * (1.0 + 1e-6)


@pytest.mark.parametrize("square", [False, True])
@pytest.mark.parametrize("make", ["sharper", "paper"])
def test_designs_meet_every_hypothesis_and_runs_keep_the_guarantee(
    make: str, square: bool, five: AnalysedGame, linear: AnalysedGame, fmu: Path, linear_fmu: Path
) -> None:
    game, archive = (five, fmu) if square else (linear, linear_fmu)
    design = sharper_design(game, k2=1.0, radius=0.1) if make == "sharper" else paper_design(game, radius=0.1)
    hypotheses = design_hypotheses(game, design)
    assert all(each.holds for each in hypotheses), hypotheses
    assert design.radius == pytest.approx(0.1, rel=1e-6)
    check_run(design, game, archive)
    if make == "sharper":
        assert max(design.gains.k1, design.gains.k3, design.gains.k4) < 1e4
    else:
        assert design.gains.k4 > 1e14


@pytest.mark.parametrize("name", ["interleaved_orders", "three_second_order", "four_first_order"])
def test_designs_of_other_games(name: str, fmu_of: FmuOf) -> None:
    game = read_game(GAMES / f"{name}.toml")
    design = sharper_design(game, k2=game.gains.k2, radius=0.05)
    assert all(each.holds for each in design_hypotheses(game, design))
    check_run(design, game, fmu_of(name))


def test_smaller_radius_leaves_the_gains_k(linear: AnalysedGame) -> None:
    wide, narrow = (sharper_design(linear, k2=1.0, radius=radius) for radius in (0.1, 0.01))
    for name in ("k1", "k2", "k3", "k4", "delta"):
        assert getattr(wide.gains, name) == getattr(narrow.gains, name)
    assert narrow.gains.W_max == wide.gains.W_max
    assert narrow.gains.beta > wide.gains.beta
    assert narrow.gains.epsilon < wide.gains.epsilon
    assert narrow.radius == pytest.approx(0.01)


def test_a_run_that_takes_too_long_is_stopped(linear: AnalysedGame, linear_fmu: Path) -> None:
    with pytest.raises(SimulationError, match="was stopped"):
        simulate(linear_fmu, linear, stop_time=5.0, time_limit=0.0)
    tiny = replace(linear.gains, epsilon=1e-10)
    with pytest.raises(SimulationError, match="epsilon"):
        simulate(linear_fmu, linear, stop_time=5.0, gains=tiny)


def test_start_of_the_design_grows_with_k2(five: AnalysedGame) -> None:
    """vbar_s(0) = v_s(0) + k2 grad f(y(0)): the theorem's set cannot be fixed before k2."""
    slow, fast = (initial_errors(replace(five.parameters, k2=k2)).velocities[0] for k2 in (1.0, 10.0))
    assert fast == pytest.approx(10.0 * slow)


# The network


def test_activations_match_the_oracle(five: AnalysedGame) -> None:
    y = ball_points(five, 4.0, 20, 1)
    other = oracle.read_game(FIVE_VEHICLES)
    np.testing.assert_allclose(activations(five, y), paper.rbf_activation(y, other.centers, other.width))


@pytest.mark.parametrize("name", ["five_vehicles", "vector_centers", "interleaved_orders"])
def test_no_network_beats_the_mirror_bound(name: str) -> None:
    """For random W, some of many points of the ball has a residual above the bound: the mirrored pair has."""
    game = read_game(FIVE_VEHICLES if name == "five_vehicles" else GAMES / f"{name}.toml")
    p = game.parameters
    radius = 6.0
    bound = mirror_bound(game, radius)
    x_star = nash_equilibrium(p).ravel()
    base, spread = game.centers[0], (game.centers[1:] - game.centers[0]).T
    Q = np.linalg.qr(spread)[0][:, : np.linalg.matrix_rank(spread)] if name != "five_vehicles" else None
    if Q is None:
        Q = np.ones((x_star.size, 1)) / math.sqrt(x_star.size)
    u = base + Q @ (Q.T @ (x_star - base))
    reach = max(0.0, radius - float(np.linalg.norm(x_star - u)))
    random = np.random.default_rng(4)
    for i in range(p.players):
        for column in range(p.dimension):
            slope = np.zeros((p.players, p.dimension))
            slope[:, column] = (
                p.dynamics_linear[i, :, column]
                + 2.0 * p.dynamics_square[i, :, column] * u.reshape(slope.shape)[:, column]
            )
            normal = slope.ravel() - Q @ (Q.T @ slope.ravel())
            if np.linalg.norm(normal) < 1e-9:
                continue
            step = reach * normal / np.linalg.norm(normal)
            pair = np.array([u + step, u - step])
            S = activations(game, pair)
            np.testing.assert_allclose(S[0], S[1], rtol=1e-9, atol=1e-300)
            assert np.linalg.norm(pair - x_star, axis=1).max() <= radius * (1 + 1e-9)
            g = np.array([p.unknown_dynamics(y.reshape(slope.shape))[i, column] for y in pair])
            for _ in range(5):
                w = random.standard_normal(len(game.centers)) * 30.0
                assert np.abs(g - S @ w).max() >= bound[i, column] * (1 - 1e-9) - 1e-9
            assert 0.5 * abs(g[0] - g[1]) == pytest.approx(bound[i, column], rel=1e-9, abs=1e-9)


def test_least_squares_fit_is_admissible_and_best(five: AnalysedGame) -> None:
    y = ball_points(five, 2.0, 4000, 0)
    S = activations(five, y)
    p = five.parameters
    g = np.array([p.unknown_dynamics(point.reshape(5, 2)) for point in y])
    random = np.random.default_rng(7)
    for W_max in (1e-3, 500.0):
        fit = least_squares_fit(five, 2.0, W_max=W_max)
        assert fit.weight_norm2.max() <= W_max * (1 + 1e-9)
        for i, column in ((0, 0), (1, 0), (4, 1)):
            w = fit.weights[i, :, column]
            least = np.sum((S @ w - g[:, i, column]) ** 2)
            for _ in range(50):
                other = w + 10.0 ** random.uniform(-4, 1) * random.standard_normal(len(w))
                other *= min(1.0, math.sqrt(W_max / np.sum(other**2)))
                assert np.sum((S @ other - g[:, i, column]) ** 2) >= least * (1 - 1e-9)


def test_trajectory_fit_is_admissible_and_no_worse(five: AnalysedGame, fmu: Path) -> None:
    seen = simulate(fmu, five, stop_time=2.0)
    assert seen.y is not None
    fit = trajectory_fit(five, seen.x, seen.y, W_max=500.0)
    assert fit.weight_norm2.max() <= 500.0 * (1 + 1e-9)
    assert np.all(fit.residual <= fit.dynamics * (1 + 1e-9))
    S = activations(five, seen.y[:, 4].reshape(len(seen.x), -1))
    g = 5.0 * seen.y[:, 4, 4, 0]
    assert np.abs(g - S @ fit.weights[4, :, 0]).max() == pytest.approx(fit.residual[4, 0])


def test_robust_term_of_the_example_fails_beyond_a_radius(five: AnalysedGame) -> None:
    """delta = 10 is too small for any W* where |y_i - x*| > 1.054, for player 5: 5 + 5 sqrt(0.9) r > 10."""
    radius = largest_representable_radius(five)
    assert radius == pytest.approx(1.0 / math.sqrt(0.9), rel=1e-6)
    from mixed_order_game.theory.domain import Domain

    assert robust_term(five, Domain(1.0, 1.0, 1.01 * radius)).holds is False
    assert robust_term(five, Domain(1.0, 1.0, 0.5)).holds is True


# The whole analysis


def test_analysis_of_the_example(fmu: Path) -> None:
    found = analyse(fmu)
    assert found.exact is not None
    assert found.value("exact", "slowest rate") == pytest.approx(6.0314572, rel=1e-6)
    assert found.value("game", "m") == pytest.approx(3.2935006, rel=1e-6)
    assert found.value("theorem 2", "met") is False
    assert found.value("simulation", "settling time") == pytest.approx(found.exact.settling_time, rel=0.01)
    assert 0.0005 < float(found.value("simulation", "radius")) < 0.003
    failing = {each.name for each in found.hypotheses if each.holds is False}
    assert {"Assumption 5: g globally Lipschitz, d bounded", "delta >= |eps_il| + |d_il|"} <= failing
    assert {"k1 > k1*", "k2 > k2*", "k3 > k3*", "k4 > k4*"} <= failing
    assert len(found.demonstrations) == 2
    for each in found.demonstrations:
        assert each.complete
        assert each.seen_radius < each.design.radius
    # What the run cannot resolve is not told as seen: 1e-11 (0.5 + 0.01) for each of ten entries.
    assert found.value("design: the paper's constants", "run's tolerance") == pytest.approx(
        1.6127e-11, rel=1e-3
    )
    assert (
        "seen less than the run's tolerance 1.61e-11, more than 6.2e+09 times smaller" in found.verdicts[-1]
    )
    # The printed level asks K = (N D epsilon + 4 N D W_max) / (0.1 / 2)^2 and with it an absurd k4.
    assert found.value("theorem 1", "K asked by print") == pytest.approx(8.00004e6)
    assert 1e27 < float(found.value("theorem 1", "k4 asked by print")) < 1e28
    assert found.value("network", "delta needed along the run") == pytest.approx(31.1, abs=0.5)
    assert any("Along the run itself delta = 10 is too small" in verdict for verdict in found.verdicts)
    assert any("Yet the run" in verdict for verdict in found.verdicts)
    assert "for k3 from 2.04 to 5e+04 1/s" in found.verdicts[0]
    # k2 = 1 exceeds k2* = 0.76, so the thresholds after it are for k2 = 1; k1* = l^2 k2^2 N / 2 + l k2 / 2.
    assert found.constants is not None
    lipschitz = found.constants.largest_lipschitz
    assert found.value("theorem 2", "k1*") == pytest.approx(2.5 * lipschitz**2 + 0.5 * lipschitz)
    assert "k1 = 10, k1* = 386.2 1/s for k2 = 1)" in found.verdicts[1]
    told = json.dumps(found.to_dict(), allow_nan=False)
    assert json.loads(told)["constants"]["monotonicity"] == pytest.approx(3.2935006)
    for tables in (False, True):
        console = Console(record=True, width=2000, file=io.StringIO())
        print_analysis(found, console, tables=tables)
        lines = console.export_text().splitlines()
        assert lines[: len(found.verdicts) + 1] == [found.title, *(f"- {each}" for each in found.verdicts)]
        assert (len(lines) > 100) is tables


def test_analysis_without_the_square(five: AnalysedGame) -> None:
    assert five.tables["player"][1]["dynamics"]["square"]
    found = analyse(FIVE_VEHICLES, square=False, simulation=False)
    holds = {each.name: each.holds for each in found.hypotheses}
    assert holds["Assumption 5: g globally Lipschitz, d bounded"] is True
    assert all(each.complete and each.seen is None for each in found.demonstrations)
    assert any("No simulation" in verdict for verdict in found.verdicts)


def test_analysis_of_unstable_gains(fmu: Path) -> None:
    found = analyse(fmu, changes={"k1": 5.0, "k3": 5.0, "k4": 5.0}, simulation=False)
    assert found.value("exact", "stable") is False
    assert any("do not converge" in verdict for verdict in found.verdicts)


def test_analysis_meets_the_thresholds_of_its_own_design(fmu: Path) -> None:
    """The designed gains, given to the analysis, meet the paper's thresholds of Theorem 1."""
    design = analyse(fmu, simulation=False).demonstrations[1].design
    found = analyse(fmu, changes=dict(vars(design.gains)), simulation=False)
    assert found.value("theorem 1", "met") is True
    # Theorem 2 asks for more: its k4* is (k2 k3 b)^2 / 2, that of Theorem 1 k3^2 b / 2.
    assert found.value("theorem 2", "met") is False
    printed = found.value("theorem 1", "radius printed")
    assert isinstance(printed, float)
    assert printed < float(found.value("theorem 1", "radius with D coordinates"))


def test_analysis_names_an_unconnected_graph(fmu: Path) -> None:
    """A game file with such a graph is refused; weights of 0 are the FMU's."""
    found = analyse(fmu, changes={"a[3,4]": 0.0, "a[4,5]": 0.0, "a[1,5]": 0.0}, simulation=False)
    told = (
        "Theorems 1 and 2 do not apply: Assumption 2: undirected connected graph, fails"
        " (lambda_min(L (x) I + A_0) = 0; no path from player 1 to 4, 5)."
    )
    assert told in found.verdicts
    assert not found.demonstrations
    assert found.value("exact", "stable") is False


def test_analysis_names_a_game_that_is_not_monotone(tmp_path: Path) -> None:
    """Every own cost is convex, but the symmetric part of h is indefinite."""
    text = FIVE_VEHICLES.read_text(encoding="utf-8")
    old = "constant = 1.0, coupling = [[2, 1.0]]"
    assert old in text
    game = tmp_path / "game.toml"
    game.write_text(text.replace(old, old.replace("[2, 1.0]", "[2, 40.0]")), encoding="utf-8")
    found = analyse(game, simulation=False)
    told = "Theorems 1 and 2 do not apply: Assumption 3: strongly monotone, fails (m = -11.39)."
    assert told in found.verdicts
    assert not found.demonstrations
    assert found.value("exact", "stable") is True


def test_analysis_refuses(fmu: Path, tmp_path: Path) -> None:
    with pytest.raises(GameError, match="radius"):
        analyse(fmu, radius=0.0)
    with pytest.raises(VariableError, match="k9"):
        analyse(fmu, changes={"k9": 1.0}, simulation=False)
    flat = tmp_path / "flat.toml"
    text = FIVE_VEHICLES.read_text(encoding="utf-8")
    for i in range(1, 6):
        text = text.replace(f"quadratic = {i}.0", "quadratic = 0.0")
    flat.write_text(text.replace("coupling = [[5, 1.0]]", "coupling = []"), encoding="utf-8")
    with pytest.raises(GameError, match="equilibrium"):
        analyse(flat, simulation=False)


def test_commands_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What docs/analyse.md shows runs, and every test that it names exists."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    root = FIVE_VEHICLES.parents[2]
    page = (root / "python_harness/docs/analyse.md").read_text(encoding="utf-8")
    lines = [line for line in page.splitlines() if line.startswith("mog analyse")]
    assert len(lines) == 4
    for line in lines:
        result = CliRunner().invoke(app, line.split()[1:])
        assert result.exit_code == 0, result.output
    sources = "".join(
        path.read_text(encoding="utf-8") for path in (root / "tests/python").glob("test_analysis_*.py")
    )
    for named in re.findall(r"`(test_\w+)`", page):
        assert f"def {named}(" in sources, named


def test_command() -> None:
    result = CliRunner().invoke(app, ["analyse", str(FIVE_VEHICLES), "--no-simulation", "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads(result.output)
    assert told["title"] == "Connectivity control of five vehicles"
    short, table = (
        CliRunner().invoke(app, ["analyse", str(FIVE_VEHICLES), "--no-simulation", *options])
        for options in ([], ["--tables"])
    )
    assert table.output.startswith(short.output)
    assert "theorem 1" in table.output.removeprefix(short.output)
    assert CliRunner().invoke(app, ["analyse", "--set", "k1"]).exit_code == 2
    help_text = CliRunner().invoke(app, ["analyse", "--help"])
    assert help_text.exit_code == 0
    assert "mog analyse" in help_text.output
