"""What an FMU says about itself, and what is told when asked for what it has not."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import ModelError, VariableError, build_fmu, default_game, read_model
from mixed_order_game.fmu.model import check_value, sources
from mixed_order_game.game.check import check_game
from mixed_order_game.theory.game import read_game
from tests.conftest import FmuOf


def test_paper_example(fmu: Path) -> None:
    model = read_model(fmu)
    assert (model.players, model.dimension, model.neurons) == (5, 2, 11)
    assert model.order == (1, 1, 1, 2, 2)
    assert model.edges == ((1, 2, 1.0), (1, 5, 1.0), (2, 3, 1.0), (3, 4, 1.0), (4, 5, 1.0))
    assert model.gains["k1"] == 10.0
    assert model.gains["rho"] == pytest.approx(5.0 * np.sqrt(2.0))
    assert (model.stop_time, model.step, model.tolerance) == (20.0, 0.02, 1e-6)
    assert model.player_names[0] == "vehicle 1"
    assert model.is_paper_example
    assert len(model.guid) > 10


def test_sources_of_the_paper_example_only(fmu: Path, fmu_of: FmuOf) -> None:
    told = {name: entry.source for entry in sources(read_model(fmu)) for name in entry.names}
    for name in ("cost_quadratic", "rho", "W_max", "beta", "delta", "epsilon", "x0", "v0"):
        assert told[name] == "the paper's"
    for name in ("k1", "k2", "k3", "k4", "a", "z0", "y0"):
        assert told[name].startswith("ours")
    assert sources(read_model(fmu_of("interleaved_orders"))) == ()
    assert read_model(fmu_of("five_vehicles_plain")).is_paper_example


def test_vector_centers_have_neurons_but_no_center_variables(fmu_of: FmuOf) -> None:
    model = read_model(fmu_of("vector_centers"))
    assert model.neurons == len(model.game["rbf"]["centers"])
    assert not model.indexed("center")


def test_select_expands_and_keeps_one_of_each(fmu: Path) -> None:
    model = read_model(fmu)
    names = [variable.name for variable in model.select(["x", "x[1,2]", "nash_error"])]
    assert len(names) == 11
    assert names[-1] == "nash_error"


def test_names_without_indices_set_all_of_their_kind(fmu: Path) -> None:
    model = read_model(fmu)
    values = model.start_values({"x0": 2, "k1": 3.0, "d_ext[1,2]": 1.0})
    assert {value for name, value in values.items() if name.startswith("x0[")} == {2.0}
    assert (values["k1"], values["d_ext[1,2]"], values["d_ext[1,1]"]) == (3.0, 1.0, 0.0)
    with pytest.raises(VariableError, match=r"a\[1,2\] is set by both a\[1,2\] and a$"):
        model.start_values({"a[1,2]": 1.0, "a": 0.0})
    with pytest.raises(VariableError, match=r"x\[1,1\] cannot be set: it is a continuous output"):
        model.start_values({"x": 0.0})
    with pytest.raises(VariableError, match="there is no variable x1; did you mean x"):
        model.start_values({"x1": 0.0})


def test_a_fixed_parameter_is_said_to_be_no_variable() -> None:
    model = read_model("cournot_isoelastic")
    for name in ("scale", "scale[1]"):
        with pytest.raises(VariableError, match="scale is fixed, a part of the game's expressions"):
            model.start_values({name: 1.0})


@pytest.mark.parametrize("text", ["k5", "nash", "W_norm", "x_stra", "dynamics_gian"])
def test_no_name_is_proposed_twice(text: str, fmu: Path) -> None:
    for look_up in (read_model(fmu).variable, lambda name: read_model(fmu).select([name])):
        with pytest.raises(VariableError) as told:
            look_up(text)
        proposed = str(told.value).partition("did you mean ")[2].rstrip("?").split(" or ")
        assert len(proposed) == len(set(proposed))


@pytest.mark.parametrize("expose", ["all", "outputs"])
def test_one_number_stands_for_all_estimates_of_a_player(expose: str, tmp_path: Path) -> None:
    text = default_game().read_text(encoding="utf-8").replace("order = 1\n", "order = 1\ny0 = 1.5\n", 1)
    game = tmp_path / "game.toml"
    game.write_text(text.replace('expose = "all"', f'expose = "{expose}"'), encoding="utf-8")
    assert check_game(game) == ()
    expected = np.zeros((5, 5, 2))
    expected[0] = 1.5
    for source in (game, build_fmu(game, tmp_path / "game.fmu")):
        np.testing.assert_array_equal(read_game(source).parameters.y0, expected)


@pytest.mark.parametrize(
    ("name", "hint"), [("K1", "k1"), ("x[6,1]", "x["), ("nasherror", "nash_error"), ("qqqqqqqq", "qqqqqqqq")]
)
def test_unknown_names_come_with_the_nearest(name: str, hint: str, fmu: Path) -> None:
    model = read_model(fmu)
    with pytest.raises(VariableError, match="there is no variable") as told:
        model.select([name])
    assert hint in str(told.value)
    with pytest.raises(VariableError, match="there is no variable"):
        model.variable(name)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("x[1,1]", 1.0, "x[1,1] cannot be set: it is a continuous output"),
        ("nash_error", 1.0, "cannot be set"),
        ("order[1]", 2.0, "order[1] cannot be set: it is a constant local"),
        ("k1", "ten", "k1 is a number, not 'ten'"),
        ("k1", True, "k1 is a number, not True"),
        ("k1", float("nan"), "k1 must be finite"),
        ("k1", float("inf"), "k1 must be finite"),
        ("a[1,2]", -1.0, "a[1,2] is -1, expected a number of at least 0"),
        ("k3", -1.0, "k3 is -1, expected a positive number"),
        ("robust", 1.0, "robust is true or false, not 1.0"),
    ],
)
def test_values_refused(name: str, value: object, told: str, fmu: Path) -> None:
    variable = read_model(fmu).variable(name)
    with pytest.raises(VariableError) as error:
        check_value(variable, value)
    assert told in str(error.value)


def test_fixed_parameters_are_refused_during_a_run(fmu: Path) -> None:
    model = read_model(fmu)
    assert check_value(model.variable("x0[1,1]"), np.float64(3.0)) == 3.0
    with pytest.raises(VariableError, match="cannot be set during a run: it is a fixed parameter"):
        check_value(model.variable("x0[1,1]"), 3.0, during_run=True)
    assert check_value(model.variable("k1"), 3, during_run=True) == 3.0
    assert check_value(model.variable("d_ext[1,1]"), 3, during_run=True) == 3.0


def test_files_that_are_no_fmu_of_ours(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="there is no FMU"):
        read_model(tmp_path / "missing.fmu")
    text = tmp_path / "text.fmu"
    text.write_text("not a zip file")
    with pytest.raises(ModelError, match="cannot be read as an FMU"):
        read_model(text)
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w") as archive:
        archive.writestr("readme", "")
    with pytest.raises(ModelError, match=r"not an FMU of this project.*game\.toml"):
        read_model(tmp_path / "empty.fmu")
    with zipfile.ZipFile(tmp_path / "game.fmu", "w") as archive:
        archive.writestr("resources/game.toml", "title = 'x'")
        archive.writestr("modelDescription.xml", "<nonsense/>")
    with pytest.raises(ModelError):
        read_model(tmp_path / "game.fmu")
