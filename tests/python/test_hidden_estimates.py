"""Games of which the FMU shows outputs alone, and games too large for what others are told."""

import re
from pathlib import Path

import numpy as np
import pytest

import mixed_order_game as mog
from mixed_order_game.explore.spectrum import spectrum_of
from mixed_order_game.fmu.build import build_fmu
from mixed_order_game.reporting.evidence import evidence_of_game
from mixed_order_game.studies import tune
from mixed_order_game.studies.claims.verdict import Verdict
from mixed_order_game.studies.validate import validate
from mixed_order_game.theory import linearized, simulation
from mixed_order_game.theory.analysis import analyse
from mixed_order_game.theory.game import read_game
from tests.conftest import GAMES
from tests.oracle import linear_loop
from tests.oracle.game import read_game as read_oracle_game


def hidden(text: str, folder: Path, name: str = "hidden") -> Path:
    """The FMU of a game file's text that is made to show outputs alone."""
    path = folder / f"{name}.toml"
    shown = re.sub(r"^expose = .*\n", "", text, flags=re.MULTILINE)
    path.write_text(re.sub(r"^dimension = ", 'expose = "outputs"\ndimension = ', shown, flags=re.MULTILINE))
    return build_fmu(path, path.with_suffix(".fmu"))


def test_the_spectrum_is_that_of_the_oracle(tmp_path: Path) -> None:
    """Of a game in coefficients the linearized loop is the loop itself, of all coordinates."""
    expected, _ = linear_loop.linear_loop(read_oracle_game(GAMES / "interleaved_orders.toml"))
    with mog.Simulator(hidden((GAMES / "interleaved_orders.toml").read_text(), tmp_path)) as simulator:
        assert not simulator.model.indexed("y")
        loop = linearized.linearized_loop(simulator)
    np.testing.assert_allclose(loop.matrix, expected, rtol=1e-12, atol=1e-9)
    assert loop.abscissa == pytest.approx(np.linalg.eigvals(expected).real.max(), rel=1e-6)


def test_runs_of_an_analysis_have_the_estimates_that_the_file_hides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (GAMES / "two_scalar_players.toml").read_text(encoding="utf-8")
    fmu = hidden(text, tmp_path)
    game = read_game(fmu)
    seen = simulation.simulate(fmu, game, stop_time=1.0)
    result = mog.run(
        GAMES / "two_scalar_players.toml", stop_time=1.0, step=0.001, tolerance=1e-11, outputs=["y"]
    )
    assert seen.y is not None
    np.testing.assert_allclose(seen.y, result.y, atol=1e-9)
    monkeypatch.setattr(simulation, "fmu_with_estimates", lambda fmu: fmu)  # as of a large game
    less = analyse(fmu)
    assert less.runs["robust"].y is None
    assert less.value("simulation", "radius") == less.runs["robust"].radius(
        0.8 * mog.read_model(fmu).stop_time
    )
    of_estimates = ("max |y_i", "seen max |y_i", "level seen", "along the run")
    assert not [row.name for row in less.rows if any(told in row.name for told in of_estimates)]
    assert any(
        told.startswith("Estimates along the runs, and V with them, are not") for told in less.verdicts
    )


def test_a_loop_too_large_for_its_eigenvalues_is_told_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = Path(mog.default_game().with_name("energy_peak_price.toml")).read_text(encoding="utf-8")
    game = hidden(text, tmp_path)
    monkeypatch.setattr(linearized, "LARGEST", 34)
    with mog.Simulator(game) as simulator:
        spectrum = spectrum_of(simulator, {})
        assert spectrum.verdict == "stable"
        assert spectrum.reason.startswith("All 35 eigenvalues have negative real parts near x*; they are too")
    counted = "all 35 eigenvalues have real parts of at most -"
    claims = {claim.name: claim for claim in validate(game, limit=5.0).claims}
    assert claims["theorem_2_stability"].verdict is Verdict.NOT_COVERED
    assert f"linearized at x*, {counted}" in claims["theorem_2_stability"].reason
    evidence = evidence_of_game(game, claims=False, stop_time=1.0)
    assert any("lower bound, as the linear loop is too large" in note for note in evidence.notes)
    found = evidence.analysis
    assert found is not None
    assert evidence.abscissa == -float(found.value("local", "slowest rate"))
    assert found.verdicts[1].startswith("Without perturbation these gains converge exponentially near x*")
    assert counted in found.verdicts[1]
    local = [row.name for row in found.rows if row.section == "local"]
    assert local == ["m", "||h||", "states", "stable", "slowest rate"]
    assert {row.section for row in found.rows} == {
        *("local", "box", "theorem 1", "theorem 2", "design: the sharper certificate")
    }
    monkeypatch.setattr(tune, "LARGEST_LINEAR", 34)
    monkeypatch.setattr(tune, "POLISH_RUNS", 6)
    tuned = tune.tune(game, 5.0, gains=["k2"])
    assert tuned.as_json()["slowest_rate"] is None
    assert any("the linear loop is too large" in note for note in tuned.notes)
    before = tuned.start_metrics[0]
    assert before is not None
    assert tuned.control_energy <= before.control_energy
