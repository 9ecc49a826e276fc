"""Grids, samples and random initial states."""

import numpy as np
import pytest
from scipy.stats import qmc

from mixed_order_game.studies.designs import (
    DesignError,
    Range,
    grid_of_text,
    initial_states,
    range_of_text,
    sample,
)
from mixed_order_game.studies.sampling import Sampling


def test_grids() -> None:
    assert grid_of_text("1,2.5,7") == (1.0, 2.5, 7.0)
    assert grid_of_text("true,false") == grid_of_text("Yes, no") == grid_of_text("on,OFF") == (True, False)
    assert grid_of_text("5:20:4") == (5.0, 10.0, 15.0, 20.0)
    assert grid_of_text("1:1000:4:log") == pytest.approx((1.0, 10.0, 100.0, 1000.0))
    assert grid_of_text("-1:1:3") == (-1.0, 0.0, 1.0)


def test_ranges() -> None:
    assert range_of_text("-5:5") == Range(-5.0, 5.0)
    assert range_of_text("1:100:log") == Range(1.0, 100.0, logarithmic=True)
    assert Range(1.0, 100.0, logarithmic=True).at(np.array([0.5])) == pytest.approx([10.0])


@pytest.mark.parametrize("sampling", list(Sampling))
def test_samples_fill_their_box(sampling: Sampling) -> None:
    ranges = {"k1": Range(5.0, 15.0), "k3": Range(1.0, 100.0, logarithmic=True)}
    points = sample(ranges, 64, sampling, seed=3)
    np.testing.assert_array_equal(points, sample(ranges, 64, sampling, seed=3))
    assert np.abs(points - sample(ranges, 64, sampling, seed=4)).max() > 0.1
    unit = np.column_stack([(points[:, 0] - 5.0) / 10.0, np.log10(points[:, 1]) / 2.0])
    # One point in each of 64 strips of every axis, which independent draws would not give.
    for column in unit.T:
        assert sorted(np.floor(64.0 * column).astype(int)) == list(range(64))
    assert qmc.discrepancy(unit) < 0.01


def test_initial_states() -> None:
    states = initial_states(6, Range(-2.0, 3.0), 4, 3, seed=9)
    assert states.shape == (6, 4, 3)
    assert states.min() >= -2.0
    assert states.max() <= 3.0
    np.testing.assert_array_equal(initial_states(2, Range(-2.0, 3.0), 4, 3, seed=9), states[:2])
    assert len(np.unique(states)) == states.size


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: grid_of_text("1,x"), "a number, true or false (yes, no, on, off) expected, not 'x'"),
        (lambda: grid_of_text("1,1"), "twice"),
        (lambda: grid_of_text("1:2"), "not a grid"),
        (lambda: grid_of_text("1:2:1"), "2 to 1000000 values, not 1"),
        (lambda: grid_of_text("1:2:99999999999"), "values, not 99999999999"),
        (lambda: grid_of_text("1:inf:3"), "not finite"),
        (lambda: range_of_text("1"), "not a range"),
        (lambda: range_of_text("2:1"), "does not go up"),
        (lambda: range_of_text("0:1:log"), "does not begin above 0"),
        (lambda: sample({"k1": Range(0.0, 1.0)}, 0, Sampling.SOBOL, 0), "samples, not 0"),
        (lambda: sample({"k1": Range(0.0, 1.0)}, 100, Sampling.SOBOL, 0), "64 or 128, not 100"),
    ],
)
def test_designs_that_make_no_sense(make: object, told: str) -> None:
    assert callable(make)
    with pytest.raises(DesignError) as error:
        make()
    assert told in str(error.value)
