"""The claims: they hold for the paper's example and the test games, and fail when they should."""

import re
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import SimulationError, Validation, build_fmu, default_game, read_model, validate
from mixed_order_game.bounds import PAPER_BOUNDS, TANH_CONSTANT, bounds, residual_seeking_error
from mixed_order_game.parameters import game_parameters
from tests.conftest import GAMES, FmuOf

CLAIMS = [
    "theorem_1_actions",
    "theorem_1_velocities",
    "lemma_3_weights",
    "consensus",
    "rejection",
    "theorem_2_convergence",
    "theorem_2_stability",
    "theorem_2_rate",
    "theorem_2_exponential",
    "archive",
]


@pytest.fixture(scope="module")
def verdict(fmu: Path) -> Validation:
    return validate(fmu)


def test_paper_example_holds(verdict: Validation) -> None:
    assert [claim.name for claim in verdict.claims] == CLAIMS
    assert verdict.notes == ()
    assert [claim.name for claim in verdict.claims if not claim.passed] == []
    figures = {claim.name: claim.figure for claim in verdict.claims}
    assert figures["theorem_1_actions"] == pytest.approx(0.00122, rel=0.02)
    assert figures["theorem_1_velocities"] == pytest.approx(0.0008, rel=0.05)
    assert figures["lemma_3_weights"] == pytest.approx(500.0)
    assert figures["rejection"] == pytest.approx(500.0, rel=0.1)
    assert figures["theorem_2_stability"] == pytest.approx(-6.031, abs=0.001)
    assert figures["theorem_2_rate"] < 0.005
    assert verdict.robust.parameters["robust"] is True
    assert verdict.plain.parameters["perturbed"] is False


def test_json(verdict: Validation) -> None:
    data = verdict.as_json()
    assert data["passed"] is True
    assert [claim["name"] for claim in data["claims"]] == CLAIMS
    assert set(data["claims"][0]) == {"name", "statement", "figure", "bound", "unit", "passed", "relation"}


@pytest.mark.parametrize("name", sorted(path.stem for path in GAMES.glob("*.toml")))
def test_other_games_hold_to_derived_bounds(name: str, fmu_of: FmuOf) -> None:
    verdict = validate(fmu_of(name))
    failed = [(c.name, c.figure, c.relation, c.bound) for c in verdict.claims if not c.passed]
    assert failed == []


def test_tighter_neighbourhood_fails(fmu: Path) -> None:
    verdict = validate(fmu, neighbourhood=1e-4)
    assert [claim.name for claim in verdict.claims if not claim.passed] == ["theorem_1_actions"]


def test_early_settle_time_fails(fmu: Path) -> None:
    verdict = validate(fmu, settle_time=0.5)
    failed = [claim.name for claim in verdict.claims if not claim.passed]
    assert "theorem_1_actions" in failed
    with pytest.raises(SimulationError, match="settle time 20 s is not within the run of 20 s"):
        validate(fmu, settle_time=20.0)


def test_unstable_gains_fail_theorem_2(tmp_path: Path) -> None:
    text = default_game().read_text()
    for old, new in (("k1 = 10.0", "k1 = 5.0"), ("k3 = 50.0", "k3 = 5.0"), ("k4 = 50.0", "k4 = 5.0")):
        assert old in text
        text = text.replace(old, new)
    game = tmp_path / "loose.toml"
    game.write_text(text.replace("robust = true", "robust = false"))
    fmu = build_fmu(game, tmp_path / "loose.fmu")
    model = read_model(fmu)
    assert not model.is_paper_example
    parameters = game_parameters(model)
    limits = bounds(model, parameters)
    assert limits.neighbourhood != PAPER_BOUNDS.neighbourhood
    verdict = validate(fmu)
    failed = {claim.name for claim in verdict.claims if not claim.passed}
    assert {"theorem_2_stability", "theorem_2_convergence"} <= failed
    assert any("do not stabilize" in note for note in verdict.notes)


def test_strongly_unstable_loop_is_judged_before_it_overflows(tmp_path: Path) -> None:
    text = default_game().read_text().replace("k2 = 1.0", "k2 = 50.0")
    game = tmp_path / "wild.toml"
    text = text.replace("order = 2", "order = 1").replace("v0 = [0.0, 0.0]", "")
    game.write_text(text.replace("square = [[2, [1.0, 0.0]]]", "square = []"))
    verdict = validate(build_fmu(game, tmp_path / "wild.fmu"))
    assert verdict.plain.stop_time < 20.0
    assert {claim.name for claim in verdict.claims if not claim.passed} >= {"theorem_2_stability"}


def test_game_that_starts_at_its_equilibrium(tmp_path: Path) -> None:
    text = re.sub(
        r"x0 = .*", "x0 = -0.5\nz0 = -0.5\ny0 = [-0.5, -0.5, -0.5, -0.5, -0.5]", default_game().read_text()
    )
    text = re.sub(r"(order = 2\nx0 = -0.5)\nz0 = -0.5", r"\1", text)
    game = tmp_path / "settled.toml"
    game.write_text(text)
    verdict = validate(build_fmu(game, tmp_path / "settled.fmu"))
    assert "theorem_2_rate" not in [claim.name for claim in verdict.claims]
    assert any("starts" in note for note in verdict.notes)
    assert verdict.plain.largest_error() < 1e-9


def test_residual_seeking_error_solves_its_equation(fmu_of: FmuOf) -> None:
    game = game_parameters(read_model(fmu_of("small_weight_bound")))
    e = residual_seeking_error(game)
    x_star = np.linalg.solve(
        2.0 * (np.diag(game.cost_quadratic + game.cost_coupling.sum(axis=1)) - game.cost_coupling),
        -game.cost_linear,
    )
    gain = np.where(game.order == 1, game.k1, game.k4)[:, np.newaxis]
    left = gain * e + game.delta * np.tanh(TANH_CONSTANT * game.delta * e / game.epsilon)
    right = np.abs(game.unknown_dynamics(x_star)) + game.disturbance_bound
    np.testing.assert_allclose(left, right, rtol=1e-9)


def test_progress_names_the_runs(fmu: Path) -> None:
    seen: dict[str, float] = {}

    def remember(name: str, part: float) -> None:
        seen[name] = part

    validate(fmu, progress=remember)
    assert list(seen) == ["robust", "not robust", "unperturbed"]
    assert all(part == pytest.approx(1.0) for part in seen.values())
