"""Figures: the curves expected with the data expected, legends and labels, files of each kind."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from mixed_order_game import PlotError, Result, ResultError
from mixed_order_game.results import plot
from mixed_order_game.results.error_figure import BELOW_FLOOR, integrator_floor
from mixed_order_game.results.plane_figure import EARLIER
from mixed_order_game.results.style import PALETTE

T, N = 400, 5
ORDER = (1, 1, 1, 2, 2)
ALL_FIRST = (1, 1, 1, 1, 1)


def make(order: tuple[int, ...] = ORDER, dimension: int = 2, stop: float = 20.0) -> Result:
    time = np.linspace(0.0, stop, T)
    columns = {}
    for i in range(1, len(order) + 1):
        for coordinate in range(1, dimension + 1):
            index = f"[{i},{coordinate}]"
            fall = (i - 3.0 * coordinate) * np.exp(-5.0 * time)
            columns[f"x{index}"] = fall - 0.5
            columns[f"u{index}"] = 0.0 * time
            columns[f"x_star{index}"] = 0.0 * time - 0.5
            if order[i - 1] == 2:
                columns[f"v{index}"] = -5.0 * fall
    columns["nash_error"] = np.exp(-5.0 * time)
    edges = {"a[1,2]": 1.0, "a[2,3]": 2.0, "a[1,3]": 0.0}
    return Result(time=time, columns=columns, parameters={"k1": 1.0, **edges}, units={"v[4,1]": "1/s"})


def curves(axes: Axes) -> dict[str, np.ndarray]:
    return {
        str(line.get_label()): np.asarray(line.get_ydata())
        for line in axes.lines
        if not str(line.get_label()).startswith("_")
    }


def legend_texts(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_positions() -> None:
    result = make()
    axes = plot.plot_positions(result)
    drawn = curves(axes)
    assert len(drawn) == N * 2
    np.testing.assert_array_equal(drawn["x[3,2]"], result["x[3,2]"])
    assert axes.get_xlabel() == "time (s)"
    assert axes.get_ylabel() == "action $x_{il}$"
    assert sorted(legend_texts(axes)) == sorted(
        [*(f"$i={i}$" for i in range(1, 6)), "$l=1$", "$l=2$", "$x^*$"]
    )
    styles = {str(line.get_label()): (line.get_color(), line.get_linestyle()) for line in axes.lines}
    assert styles["x[1,1]"][0] == styles["x[1,2]"][0] != styles["x[2,1]"][0]
    assert styles["x[1,1]"][1] == styles["x[2,1]"][1] != styles["x[1,2]"][1]


def test_velocities_of_second_order_players_only() -> None:
    axes = plot.plot_velocities(make())
    assert set(curves(axes)) == {"v[4,1]", "v[4,2]", "v[5,1]", "v[5,2]"}
    assert axes.get_ylabel() == "velocity $v_{il}$ (1/s)"
    with pytest.raises(PlotError, match="no player of this game has a velocity"):
        plot.plot_velocities(make(ALL_FIRST))


def test_error_is_logarithmic() -> None:
    axes = plot.plot_error({"one": make(), "two": make(stop=5.0)})
    assert axes.get_yscale() == "log"
    assert set(curves(axes)) == {"one", "two"}
    assert legend_texts(axes) == ["one", "two"]
    assert plot.plot_error(make()).get_legend() is None


def test_plane_draws_paths_graph_and_equilibrium() -> None:
    result = make()
    axes = plot.plot_plane(result)
    paths = [line for line in axes.lines if line.get_gid() == "path"]
    edges = [line for line in axes.lines if line.get_gid() == "edge"]
    assert len(paths) == N
    np.testing.assert_array_equal(paths[3].get_xdata(), result["x[4,1]"])
    ends = [np.column_stack(line.get_data()) for line in edges]
    np.testing.assert_array_equal(ends, [result.x[0, [0, 1]], result.x[0, [1, 2]]])
    assert [text.get_text() for text in axes.texts] == ["1", "2", "3", "4", "5"]
    assert len([line for line in plot.plot_plane(result, edges=[]).lines if line.get_gid() == "edge"]) == 0
    with pytest.raises(PlotError, match="3 coordinates, not 2"):
        plot.plot_plane(make(dimension=3))


def changed_costs() -> Result:
    """The equilibrium of player 2 steps from -0.5 to 1 after sample 100, both coordinates."""
    result = make()
    for coordinate in (1, 2):
        result.columns[f"x_star[2,{coordinate}]"][101:] = 1.0
    return result


def test_the_equilibrium_is_drawn_as_it_was_at_each_time() -> None:
    axes = plot.plot_positions(changed_costs())
    levels = [line for line in axes.lines if str(line.get_label()).startswith("_")]
    values = [np.asarray(line.get_ydata()) for line in levels]
    assert sorted((each[0], each[-1]) for each in values) == [(-0.5, -0.5), (-0.5, 1.0)]
    moved, drawn = max(zip(levels, values, strict=True), key=lambda pair: float(pair[1][-1]))
    assert moved.get_drawstyle() == "steps-pre"  # a change acts from its sample on, shown by the next one
    assert drawn[100:102].tolist() == [-0.5, 1.0]
    plane = plot.plot_plane(changed_costs())
    crosses = {
        str(line.get_color()): np.asarray(line.get_xydata())
        for line in plane.lines
        if str(line.get_marker()) in "xX"
    }
    np.testing.assert_array_equal(crosses[EARLIER], [[-0.5, -0.5]])
    np.testing.assert_array_equal(crosses["black"], [[-0.5, -0.5]])  # where four players' equilibria meet
    np.testing.assert_array_equal(crosses[PALETTE[1]], [[1.0, 1.0]])
    assert "equilibrium before" in legend_texts(plane)
    assert "equilibrium before" not in legend_texts(plot.plot_plane(make()))


def test_errors_within_the_tolerance_are_shaded() -> None:
    """The floor is |tolerance |x*| + absolute tolerance|, ten entries of 0.5e-8 + 1e-10."""
    result = replace(make(), tolerance=1e-8)
    floor = integrator_floor(result)
    assert floor == pytest.approx(np.sqrt(10.0) * 5.1e-9)
    other = replace(result, parameters={"tolerance_relative": 1e-6, "tolerance_absolute": 1e-3})
    assert integrator_floor(other) == pytest.approx(np.sqrt(10.0) * (0.5e-6 + 1e-3))
    axes = plot.plot_error({"above": replace(make(stop=1.0), tolerance=1e-8), "below": result})
    assert legend_texts(axes) == ["above", "below"]
    assert [text.get_text() for text in axes.texts] == ["within the integrator's tolerance"]
    assert axes.get_ylim()[0] == pytest.approx(BELOW_FLOOR * floor)
    (shade,) = axes.patches
    assert shade.get_extents().transformed(axes.transData.inverted()).y1 == pytest.approx(floor)
    assert len(plot.plot_error(make()).patches) == 0  # of an unknown tolerance nothing is shaded


def test_a_result_is_drawn_as_far_as_it_goes() -> None:
    """What was not recorded has no figure, and is not said not to exist."""
    whole = replace(make(), parameters={"v0[4,1]": 0.0, "k1": 1.0})
    drawn = ["positions", "velocities", "error", "plane", "control"]
    assert list(plot.result_figures(whole)) == drawn
    for left_out, kept in (
        ("v", ["positions", "error", "plane", "control"]),
        ("x", ["velocities", "error", "control"]),
        ("nash_error", ["positions", "velocities", "plane", "control"]),
    ):
        part = {name: each for name, each in whole.columns.items() if name.split("[")[0] != left_out}
        assert list(plot.result_figures(replace(whole, columns=part))) == kept
    assert list(plot.result_figures(whole, ["error"])) == ["error"]
    with pytest.raises(ResultError, match="W_norm2 was not recorded"):
        plot.result_figures(whole, ["weights"])
    bare = {name: each for name, each in whole.columns.items() if name.startswith("x_star")}
    with pytest.raises(ResultError, match="v was not recorded"):
        plot.plot_velocities(replace(whole, columns=bare))
    with pytest.raises(ResultError, match="nothing to draw"):
        plot.result_figures(replace(whole, columns=bare, parameters={"v0[4,1]": 0.0}))


def test_players_of_order_2_alone_share_their_actions() -> None:
    """They have no references: what was never there is not asked to be recorded."""
    run = make((2, 2), 1)
    estimates = {
        f"y[{i},{j},1]": run[f"x[{j},1]"] + 0.1 * i * np.exp(-run.time) for i in (1, 2) for j in (1, 2)
    }
    run = replace(run, columns={**run.columns, **estimates})
    parameters = {f"v0[{i},1]": 0.0 for i in (1, 2)}
    without_v = {name: each for name, each in run.columns.items() if name[0] != "v"}
    for alike in (run, replace(run, columns=without_v, parameters=parameters)):
        assert np.isnan(alike.z).all()
        np.testing.assert_array_equal(alike.xbar, alike.x)
        drawn = curves(plot.plot_estimates(alike))
        np.testing.assert_allclose(drawn["y[1,1]"], 0.2 * np.exp(-run.time), rtol=1e-12, atol=1e-15)
    with pytest.raises(ResultError, match="z was not recorded"):
        _ = replace(make(), parameters={"z0[1,1]": 0.0}).xbar


def test_inset_enlarges_a_short_transient_and_covers_no_settled_curve() -> None:
    (inset,) = plot.plot_positions(make()).child_axes
    assert inset.get_xlim()[1] < 2.0
    parent = plot.plot_positions(make())
    low, high = parent.get_ylim()
    settled = (-0.5 - low) / (high - low)
    box = parent.child_axes[0].get_position()
    own = parent.get_position()
    bottom, top = ((edge - own.y0) / own.height for edge in (box.y0, box.y1))
    assert not bottom < settled < top
    assert plot.plot_positions(make(stop=1.0)).child_axes == []


def test_axes_of_the_caller_are_used() -> None:
    axes = plot.new_axes(4.0)
    assert plot.plot_positions(make(), axes) is axes
    figure = axes.get_figure(root=True)
    assert figure is not None
    assert figure.get_size_inches()[0] == 4.0


def test_paper_figures() -> None:
    four = ["positions_robust", "positions_unperturbed", "velocities_robust", "velocities_unperturbed"]
    assert list(plot.paper_figures(make(), make(stop=5.0))) == [*four, "error", "plane"]
    assert list(plot.paper_figures(make(ALL_FIRST, 1), make(ALL_FIRST, 1))) == [
        "positions_robust",
        "positions_unperturbed",
        "error",
    ]


def test_many_players_are_not_named_one_by_one() -> None:
    axes = plot.plot_positions(make((1, 2) * 10))
    assert legend_texts(axes) == ["$l=1$", "$l=2$", "$x^*$"]
    assert len({str(line.get_color()) for line in axes.lines if str(line.get_label())[0] == "x"}) == 20


@pytest.mark.parametrize(("suffix", "begin"), [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_files_are_reproducible(suffix: str, begin: bytes, tmp_path: Path) -> None:
    written = [
        plot.save_figure(plot.plot_plane(make()), tmp_path / name / f"plane{suffix}").read_bytes()
        for name in ("a", "b")
    ]
    assert written[0].startswith(begin)
    assert written[0] == written[1]


def test_unknown_format(tmp_path: Path) -> None:
    with pytest.raises(PlotError, match=r"must end in \.pdf, \.svg or \.png"):
        plot.save_figure(plot.new_axes(), tmp_path / "a.bmp")
