"""Runs side by side: what the baselines leave out, what stands in the table, what cannot be compared."""

import json
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import ResultError, VariableError, run
from mixed_order_game.results.metrics import METRIC_UNITS
from mixed_order_game.studies.compare import (
    AS_IT_IS,
    CompareError,
    Comparison,
    compare,
    compare_results,
    load_results,
)


@pytest.fixture(scope="module")
def compared(fmu: Path) -> Comparison:
    return compare(fmu, {"high gain": {"k1": 20.0}}, start_values={"k4": 60.0})


def test_runs(compared: Comparison) -> None:
    labels = [AS_IT_IS, "high gain", "without network", "without phi", "without both"]
    assert [run.label for run in compared.runs] == labels
    assert list(compared.results) == labels
    assert compared[AS_IT_IS].changed == {"k4": 60.0}
    assert compared["high gain"].changed == {"k1": 20.0, "k4": 60.0}
    assert compared["without both"].changed == {"robust": False, "k4": 60.0}
    assert list(compared.table()) == list(METRIC_UNITS)
    assert len({run.metrics.band for run in compared.runs if run.metrics}) == 1


def test_baselines_leave_out_what_they_say(fmu: Path) -> None:
    for values, network, phi in (({"beta": 0.0}, False, True), ({"delta": 0.0}, True, False)):
        result = run(fmu, start_values=values, stop_time=1.0)
        assert (np.abs(result.nn).max() > 0.0) == network
        assert (np.abs(result.W_norm2).max() > 0.0) == network
        assert (np.abs(result.phi).max() > 0.0) == phi
    neither = run(fmu, start_values={"beta": 0.0, "delta": 0.0}, stop_time=1.0, tolerance=1e-9)
    both = run(fmu, start_values={"robust": False}, stop_time=1.0, tolerance=1e-9)
    np.testing.assert_allclose(neither.x, both.x, atol=1e-6)


def test_the_robust_part_is_worth_it(compared: Comparison) -> None:
    final = compared.table()["final_error"]
    assert final[AS_IT_IS] < final["without network"] < final["without phi"] < final["without both"]
    assert final["without both"] > 100.0 * final[AS_IT_IS]
    assert compared.table()["events"]["without network"] == 0.0


def test_plain_values(compared: Comparison) -> None:
    data = json.loads(json.dumps(compared.as_json(), allow_nan=False))
    assert data["without both"]["changed"]["robust"] is False
    assert data[AS_IT_IS]["guid"].startswith("{")
    assert data[AS_IT_IS]["metrics"]["settling_time"] > 0.0
    assert "high gain" in repr(compared)


def test_run_that_the_fmu_gives_up(fmu: Path) -> None:
    found = compare(fmu, {"wild": {"robust": False, "x0[2,1]": 1000.0, "k1": 0.1}}, baselines=False)
    assert found["wild"].metrics is None
    assert found["wild"].error
    assert np.isnan(found.table()["final_error"]["wild"])
    assert list(found.results) == [AS_IT_IS]


def test_results_from_files(fmu: Path, tmp_path: Path) -> None:
    first = run(fmu, stop_time=2.0).save(tmp_path / "first.parquet")
    second = run(fmu, stop_time=2.0, start_values={"k1": 20.0}).save(tmp_path / "second.csv")
    results = load_results([first, second])
    found = compare_results(results)
    assert [each.label for each in found.runs] == ["first", "second"]
    assert found["first"].metrics == results["first"].metrics
    (tmp_path / "other").mkdir()
    third = run(fmu, stop_time=0.1).save(tmp_path / "other" / "first.parquet")
    assert list(load_results([first, third])) == [str(first), str(third)]
    with pytest.raises(ResultError, match="twice"):
        load_results([first, first])


def test_what_cannot_be_compared(fmu: Path, compared: Comparison) -> None:
    with pytest.raises(CompareError, match="no run is called 'x'"):
        compared["x"]
    with pytest.raises(CompareError, match="two runs are called 'without phi'"):
        compare(fmu, {"without phi": {}})
    with pytest.raises(VariableError, match="k9"):
        compare(fmu, {"a": {"k9": 1.0}}, stop_time=0.1)
