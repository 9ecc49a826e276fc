"""The package at its top level: every function takes a game in any form, and tells all of itself."""

import copy
import doctest
import importlib
import inspect
import logging
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import griffe
import pytest

import mixed_order_game as mog
from mixed_order_game.studies.sampler import Settings

GAME = "energy_consumption"
FUNCTIONS = [name for name in dir(mog) if inspect.isfunction(getattr(mog, name))]
METHODS: list[Any] = [mog.Result.plot, mog.Game]
DOCUMENTED = [getattr(mog, name) for name in FUNCTIONS if name != "package_version"] + METHODS


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def forms() -> Iterator[Any]:
    """The game of the package by its name, its file, an object and its FMU."""
    yield GAME
    game = mog.Game(GAME)
    yield game.write("rivals.toml", force=True)
    yield game
    yield str(game.build("rivals.fmu"))


def test_every_function_takes_a_game_by_name_file_and_object() -> None:
    calls: dict[str, Callable[[Any], Any]] = {
        "run": lambda game: mog.run(game, stop_time=0.2)["x[1,1]"].tolist(),
        "compare": lambda game: mog.compare(game, baselines=False, stop_time=0.2).table()["control_energy"],
        "analyse": lambda game: mog.analyse(game, simulation=False).verdicts,
        "sweep": lambda game: mog.sweep(
            game, grid={"k2": (0.5, 1.0)}, jobs=1, settings=Settings(stop_time=0.2)
        )["final_error"].tolist(),
        "read_model": lambda game: mog.read_model(game).order,
    }
    for name, call in calls.items():
        found = [call(game) for game in forms()]
        assert found[1:] == found[:-1], name


def test_a_changed_object_is_what_is_judged() -> None:
    game = mog.Game(GAME)
    game["gains"]["k2"] = 0.5
    assert mog.compare(game, baselines=False, stop_time=0.1).runs[0].result is not None
    assert mog.run(game, stop_time=0.1).parameters["k2"] == 0.5
    assert mog.report(game, "page.html", claims=False, stop_time=0.2).evidence.result.parameters["k2"] == 0.5
    del game["gains"]["k1"]
    with pytest.raises(mog.GameError, match=r"the game: gains\.k1 is missing"):
        mog.run(game)


def test_results_are_taken_as_files_and_objects() -> None:
    result = mog.run(GAME, stop_time=0.2)
    path = result.save("first.csv")
    found = mog.compare([path, result, GAME], baselines=False, stop_time=0.2)
    assert [run.label for run in found.runs] == ["first", result.title, f"{GAME}: as it is"]
    assert found.table()["final_error"]["first"] == found.table()["final_error"][result.title]
    with pytest.raises(ValueError, match="not run again"):
        mog.compare([path], {"a": {"k1": 1.0}})
    assert mog.report(result, "page.html").evidence.result is result


def test_results_show_themselves_in_a_notebook() -> None:
    verdict = mog.validate(GAME, limit=1.0)
    shown: dict[str, Any] = {
        "x at the end": mog.run(GAME, stop_time=0.1, start_values={"k2": 2.0}),
        "not settled": verdict,
        "as it is": mog.compare(GAME, baselines=False, stop_time=0.1),
        "Figures": mog.analyse(GAME, simulation=False),
        "Game file": mog.Game(GAME),
        "settling time": mog.sweep(GAME, grid={"k2": (1.0,)}, jobs=1, settings=Settings(stop_time=0.1)),
    }
    for part, each in shown.items():
        page = each._repr_html_()
        assert page.startswith("<div>")
        assert part in page
        assert len(repr(each)) < 150
    hostile = mog.Game({"title": "<script>", "player": []})
    assert "<script>" not in hostile._repr_html_()
    assert verdict.plot().get_yscale() == "log"


def test_what_is_said_of_run_holds_for_a_simulator() -> None:
    own, told = (inspect.signature(each).parameters for each in (mog.Simulator.run, mog.run))
    described = {name: (each.kind, each.default) for name, each in told.items() if name != "game"}
    assert {name: (each.kind, each.default) for name, each in own.items() if name != "self"} == described


@pytest.mark.parametrize("documented", DOCUMENTED, ids=lambda each: str(each.__qualname__))
def test_every_parameter_is_described(documented: Any) -> None:
    text = inspect.getdoc(documented)
    assert text
    sections = {section.kind.value: section for section in griffe.Docstring(text).parse("numpy")}
    names = [
        f"{'**' if each.kind is each.VAR_KEYWORD else ''}{name}"
        for name, each in inspect.signature(documented).parameters.items()
        if name != "self"
    ]
    told = sections["parameters"].value if "parameters" in sections else []
    assert [each.name for each in told] == names
    assert "returns" in sections or inspect.isclass(documented)
    if names:
        assert "raises" in sections


@pytest.mark.parametrize("documented", DOCUMENTED, ids=lambda each: str(each.__qualname__))
def test_examples_do_what_they_show(documented: Any) -> None:
    names = {"mog": mog}
    for example in doctest.DocTestFinder(recurse=False).find(documented, globs=names):
        runner = doctest.DocTestRunner()
        runner.run(example)
        assert runner.failures == 0


def test_every_error_can_be_made_without_its_init() -> None:
    """As what sends them between processes does."""
    known = [mog.MixedOrderGameError]
    for each in known:
        known += each.__subclasses__()
        assert str(each.__new__(each, "told")) == "told"
    assert len(known) > 20


def raised(call: Callable[[], Any]) -> Exception:
    with pytest.raises(mog.MixedOrderGameError) as found:
        call()
    return found.value


def test_errors_are_python_s_own_where_it_has_the_word() -> None:
    result = mog.run(GAME, stop_time=0.1, outputs=["x"])
    Path("text.toml").write_text("text", encoding="utf-8")
    result.save("rivals.csv")
    calls: list[tuple[Callable[[], Any], type[Exception], type[Exception]]] = [
        (lambda: mog.run("none.toml"), mog.GameError, FileNotFoundError),
        (lambda: mog.run("nothing"), mog.GameError, FileNotFoundError),
        (lambda: mog.run("none.fmu"), mog.ModelError, FileNotFoundError),
        (lambda: mog.load("none.csv"), mog.ResultError, FileNotFoundError),
        (lambda: mog.Game("none.toml"), mog.GameError, FileNotFoundError),
        (lambda: mog.Game("text.toml"), mog.GameError, ValueError),
        (lambda: mog.Game(GAME)["nothing"], mog.GameError, KeyError),
        (lambda: mog.Game(GAME).player(9), mog.GameError, KeyError),
        (lambda: mog.Game(GAME).write("text.toml"), mog.ResultError, FileExistsError),
        (lambda: mog.run(GAME, start_values={"k9": 1.0}), mog.VariableError, KeyError),
        (lambda: mog.run(GAME, start_values={"k1": -1.0}), mog.VariableError, ValueError),
        (lambda: mog.run(GAME, stop_time=-1.0), mog.SimulationError, ValueError),
        (lambda: mog.run(GAME, inputs=[[1.0]]), mog.SimulationError, ValueError),
        (lambda: mog.validate(GAME, limit=0.0), mog.SimulationError, ValueError),
        (lambda: mog.analyse(GAME, radius=0.0), mog.GameError, ValueError),
        (lambda: mog.tune(GAME, -1.0), mog.MixedOrderGameError, ValueError),
        (lambda: result["u[1,1]"], mog.ResultError, KeyError),
        (lambda: result.u, mog.ResultError, KeyError),
        (lambda: result.plot("pie"), mog.PlotError, ValueError),
        (lambda: mog.compare(GAME, {"as it is": {}}), mog.MixedOrderGameError, ValueError),
        (lambda: mog.compare(GAME, baselines=False, stop_time=0.1)["b"], mog.MixedOrderGameError, KeyError),
    ]
    for call, ours, python_s in calls:
        error = raised(call)
        assert isinstance(error, ours)
        assert isinstance(error, python_s), error
        assert str(error) == error.args[0]  # a KeyError's own text stands in quotes
        for again in (copy.copy(error), pickle.loads(pickle.dumps(error))):  # noqa: S301 - our own
            assert (type(again), str(again)) == (type(error), str(error))


def test_what_is_done_is_logged_in_the_namespace_of_the_package(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="mixed_order_game"):
        mog.run(GAME, stop_time=0.1)
    assert [record.name for record in caplog.records] == ["mixed_order_game.fmu.run"]
    assert "from 0 to 0.1 s" in caplog.text
    root = importlib.import_module("logging").getLogger("mixed_order_game")
    assert any(isinstance(handler, logging.NullHandler) for handler in root.handlers)
