"""FMUs of some players and of external plants: what they hold, and parts against the whole."""

import ctypes
import tomllib
import zipfile
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import fmpy.ssp
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu
from lxml import etree
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from mixed_order_game.errors import GameError
from mixed_order_game.fmu.build import build_fmu, shipped_game
from mixed_order_game.fmu.model import read_model
from mixed_order_game.fmu.parts import build_part, build_ssp, longest_sampled_step
from mixed_order_game.game.parts import part_of_game, toml_of_game
from tests.games_in_parts import EXPRESSIONS, GAME, GAMES, OWN_GAINS
from tests.oracle.game import game_from_table
from tests.oracle.simulate import simulate

Floats = NDArray[np.float64]


def written(folder: Path, text: str) -> Path:
    path = folder / "game.toml"
    path.write_text(text, encoding="utf-8")
    return path


def members(archive: Path) -> dict[str, str]:
    with zipfile.ZipFile(archive) as file:
        return {name: file.read(name).decode("utf-8", "replace") for name in file.namelist()}


def test_a_part_says_nothing_of_the_others(tmp_path: Path) -> None:
    fmu = build_part(written(tmp_path, EXPRESSIONS), [2], tmp_path / "beta.fmu")
    texts = {name: text for name, text in members(fmu).items() if not name.startswith("binaries/")}
    for foreign in ("secret_price", "alpha", "gamma", "exp(", "sin(", "0.125", "x_star", "nash_error"):
        assert not [
            name for name, text in texts.items() if foreign in text and "documentation/" not in name
        ], foreign
    held = tomllib.loads(texts["resources/game.toml"])
    assert held["player"][0] == {"elsewhere": True, "order": 1}
    assert held["player"][1]["y0"] == [[1.0, -2.0], [0.5, 1.5], [-1.0, 2.0]]
    assert held["parameters"] == {"drag": 0.25}
    assert validate_fmu(str(fmu)) == []
    model = read_model(fmu)
    assert {name for name in model.variables if name.startswith("a[")} == {"a[2,1]", "a[2,3]"}
    of = {
        kind: {name.split("[")[0] for name, each in model.variables.items() if each.causality == kind}
        for kind in ("input", "output")
    }
    assert of == {"input": {"d_ext", "x", "y", "xbar"}, "output": {"x", "v", "u", "xbar", "y"}}
    assert model.variable("x[1,2]").causality == "input"
    assert "x[3,1]" not in model.variables


def test_a_game_file_of_a_part_is_read_back() -> None:
    tables = part_of_game(tomllib.loads(OWN_GAINS), [1, 3])
    assert tomllib.loads(toml_of_game(tables)) == tables
    whole = tomllib.loads(GAME)
    assert part_of_game(whole, [1, 2, 3]) == whole
    for players in ([], [0], [4]):
        with pytest.raises(GameError, match="expected numbers from 1 to 3"):
            part_of_game(whole, players)
    with pytest.raises(GameError, match="holds a part of a game already"):
        part_of_game(tables, [1])


class Coupled:
    """Model-exchange FMUs whose inputs follow each other's outputs of the same name, as one system."""

    def __init__(self, fmus: Sequence[Path], folder: Path) -> None:
        self.parts: list[tuple[FMU2Model, Any, int, list[int], list[str]]] = []
        self.outputs: dict[str, tuple[int, int]] = {}
        for number, fmu in enumerate(fmus):
            unzipped = fmpy.extract(str(fmu), unzipdir=str(folder / f"part{number}"))
            description = fmpy.read_model_description(str(fmu), validate=False)
            model = FMU2Model(
                guid=description.guid,
                unzipDirectory=unzipped,
                modelIdentifier=description.modelExchange.modelIdentifier,
                instanceName=f"part{number}",
            )
            model.instantiate()
            model.setupExperiment(tolerance=1e-9, startTime=0.0)
            model.enterInitializationMode()
            model.exitInitializationMode()
            model.newDiscreteStates()
            model.enterContinuousTimeMode()
            variables = {each.name: each.valueReference for each in description.modelVariables}
            inputs = [each.name for each in description.modelVariables if each.causality == "input"]
            wired = [name for name in inputs if not name.startswith("d_ext")]
            for each in description.modelVariables:
                if each.causality == "output":
                    self.outputs[each.name] = (number, each.valueReference)
            self.parts.append(
                (
                    model,
                    description,
                    description.numberOfContinuousStates,
                    [variables[n] for n in wired],
                    wired,
                )
            )

    def state(self) -> Floats:
        return np.concatenate(
            [self._of(model.getContinuousStates, size) for model, _, size, _, _ in self.parts]
        )

    def rate(self, t: float, state: Floats) -> Floats:
        begin = 0
        for model, _, size, _, _ in self.parts:
            model.setTime(t)
            values = np.ascontiguousarray(state[begin : begin + size])
            model.setContinuousStates(values.ctypes.data_as(_pointer), size)
            begin += size
        for model, _, _, references, names in self.parts:
            sources = [self.outputs[name] for name in names]
            model.setReal(references, [self.parts[part][0].getReal([vr])[0] for part, vr in sources])
        return np.concatenate([self._of(model.getDerivatives, size) for model, _, size, _, _ in self.parts])

    def read(self, name: str) -> float:
        part, reference = self.outputs[name]
        return float(self.parts[part][0].getReal([reference])[0])

    def free(self) -> None:
        for model, *_ in self.parts:
            model.terminate()
            model.freeInstance()

    @staticmethod
    def _of(get: Callable[..., Any], size: int) -> Floats:
        values = np.empty(size)
        get(values.ctypes.data_as(_pointer), size)
        return values


_pointer = ctypes.POINTER(ctypes.c_double)


def integrated(fmus: Sequence[Path], folder: Path, stop: float, names: Collection[str]) -> dict[str, float]:
    coupled = Coupled(fmus, folder)
    try:
        end = solve_ivp(coupled.rate, (0.0, stop), coupled.state(), method="LSODA", rtol=1e-9, atol=1e-10)
        coupled.rate(stop, end.y[:, -1])
        return {name: coupled.read(name) for name in names}
    finally:
        coupled.free()


@pytest.mark.parametrize("name", GAMES)
@pytest.mark.parametrize("groups", [[[1], [2], [3]], [[1, 3], [2]]], ids=["apart", "groups"])
def test_parts_integrated_together_are_the_whole(name: str, groups: list[list[int]], tmp_path: Path) -> None:
    game = written(tmp_path, GAMES[name])
    outputs = [f"{stem}[{i},{c}]" for i in (1, 2, 3) for c in (1, 2) for stem in ("x", "u")]
    whole = integrated([build_fmu(game, tmp_path / "whole.fmu")], tmp_path / "whole", 0.5, outputs)
    fmus = [build_part(game, group, tmp_path / f"part{k}.fmu") for k, group in enumerate(groups)]
    parts = integrated(fmus, tmp_path / "parts", 0.5, outputs)
    assert max(abs(parts[each] - whole[each]) for each in outputs) < 1e-6
    assert max(abs(whole[f"x[{i},1]"]) for i in (1, 2, 3)) > 0.1


def schema_of(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(Path(fmpy.ssp.__file__).parent / "schema" / name))


def test_a_system_structure_is_valid_and_wired_along_the_graph(tmp_path: Path) -> None:
    ssp = build_ssp(written(tmp_path, GAME), tmp_path / "game.ssp", groups=[[1], [2, 3]])
    texts = members(ssp)
    assert set(texts) == {
        "SystemStructure.ssd",
        *(f"resources/{name}.{end}" for name in ("player_1", "players_2_3") for end in ("fmu", "ssv")),
    }  # fmt: skip
    assert "<ssd:SystemStructureDescription" in texts["SystemStructure.ssd"]
    assert "<ssv:ParameterSet" in texts["resources/player_1.ssv"]
    schema_of("SystemStructureDescription.xsd").assertValid(
        etree.fromstring(texts["SystemStructure.ssd"].encode())
    )
    for name in ("player_1", "players_2_3"):
        schema_of("SystemStructureParameterValues.xsd").assertValid(
            etree.fromstring(texts[f"resources/{name}.ssv"].encode())
        )
    system = read_ssd(str(ssp)).system
    wires = {(c.startElement, c.startConnector, c.endElement, c.endConnector) for c in system.connections}
    assert all(start == end for _, start, _, end in wires)
    heard = {f"{s}[{k},{c}]" for s, k in (("xbar", 2), ("x", 3)) for c in (1, 2)}
    heard |= {f"y[2,{j},{c}]" for j in (1, 2, 3) for c in (1, 2)}
    assert {end for _, _, to, end in wires if to == "player_1"} == heard
    units = {
        (component.get("name"), connector.get("name")): connector[0].get("unit")
        for component in etree.fromstring(texts["SystemStructure.ssd"].encode()).iter("{*}Component")
        for connector in component.iter("{*}Connector")
    }
    assert all(units[a, start] == units[b, end] for a, start, b, end in wires)
    with pytest.raises(GameError, match="each player from 1 to 3 in one of them"):
        build_ssp(written(tmp_path, GAME), tmp_path / "game.ssp", groups=[[1], [2]])


def test_the_difference_by_co_simulation_falls_with_the_step(tmp_path: Path) -> None:
    game = written(tmp_path, GAME)
    ssp = build_ssp(game, tmp_path / "game.ssp")
    whole = integrated([build_fmu(game, tmp_path / "whole.fmu")], tmp_path / "whole", 1.0, X := _actions())
    differences = []
    for step in (0.02, 0.01, 0.005):
        rows = simulate_ssp(str(ssp), stop_time=1.0 - 0.5 * step, step_size=step)
        last = {name: rows[f"player_{name[2]}.{name}"][-1] for name in X}
        differences.append(max(abs(last[name] - whole[name]) for name in X))
    assert all(fine < 0.6 * coarse for coarse, fine in pairwise(differences)), differences


def _actions() -> list[str]:
    return [f"x[{i},{c}]" for i in (1, 2, 3) for c in (1, 2)]


def external(text: str, name: str) -> str:
    """The same game with a player's plant outside."""
    head, *players = text.split("[[player]]")
    for k, player in enumerate(players):
        if f'"{name}"' in player:
            kept = [
                line
                for line in player.splitlines()
                if not line.startswith(("x0", "v0", "dynamics", "disturbance"))
            ]
            players[k] = "\n".join([*kept, 'plant = "external"', ""])
    return "[[player]]".join([head, *players])


@pytest.mark.parametrize(("name", "player", "order"), [("alpha", 1, 1), ("beta", 2, 2)])
def test_an_external_plant_is_driven_as_by_the_oracle(
    name: str, player: int, order: int, tmp_path: Path
) -> None:
    """The law alone, told the actions of the oracle's run, gives the oracle's control."""
    step, stop = 0.01, 1.0
    times = np.arange(0.0, stop + 0.5 * step, step)
    run = simulate(game_from_table(tomllib.loads(GAME)), times, rtol=1e-9, atol=1e-10)
    fmu = build_fmu(written(tmp_path, external(GAME, name)), tmp_path / "external.fmu")
    assert validate_fmu(str(fmu)) == []
    model = read_model(fmu)
    assert f"d_ext[{player},1]" not in model.variables
    assert f"x0[{player},1]" not in model.variables
    assert f"disturbance_bias[{player},1]" not in model.variables
    bound = longest_sampled_step(model)[player]
    k, delta, epsilon = (8.0 if order == 1 else 20.0), 3.0, 0.5
    assert bound == pytest.approx(2.0 / (k + 0.2784645427610738 * delta**2 / epsilon))
    signals = {f"x[{player},{c + 1}]": run.x[:, player - 1, c] for c in range(2)}
    if order == 2:
        signals |= {f"v[{player},{c + 1}]": run.v[:, player - 1, c] for c in range(2)}
    others = [f"x[{i},{c}]" for i in (1, 2, 3) if i != player for c in (1, 2)]
    found = driven(fmu, times, signals, [f"u[{player},1]", f"u[{player},2]", *others])
    for c in range(2):
        expected = run.u[:, player - 1, c]
        assert np.abs(found[f"u[{player},{c + 1}]"] - expected).max() < 2e-4 * np.abs(expected).max()
    for each in others:
        i, c = int(each[2]) - 1, int(each[4]) - 1
        assert np.abs(found[each] - run.x[:, i, c]).max() < 1e-5


def test_a_part_moves_as_by_the_oracle(tmp_path: Path) -> None:
    """Player 1 alone, told what the oracle's run has of the others, moves as in that run."""
    times = np.arange(0.0, 1.005, 0.01)
    run = simulate(game_from_table(tomllib.loads(GAME)), times, rtol=1e-9, atol=1e-10)
    signals = {f"x[3,{c + 1}]": run.x[:, 2, c] for c in range(2)}
    signals |= {f"xbar[2,{c + 1}]": run.x[:, 1, c] for c in range(2)}  # of order 2
    signals |= {f"y[2,{j + 1},{c + 1}]": run.y[:, 1, j, c] for j in range(3) for c in range(2)}
    fmu = build_part(written(tmp_path, GAME), [1], tmp_path / "part.fmu")
    expected = {f"x[1,{c + 1}]": run.x[:, 0, c] for c in range(2)}
    expected |= {f"u[1,{c + 1}]": run.u[:, 0, c] for c in range(2)}
    expected |= {f"xbar[1,{c + 1}]": run.z[:, 0, c] for c in range(2)}
    expected |= {f"y[1,{j + 1},{c + 1}]": run.y[:, 0, j, c] for j in range(3) for c in range(2)}
    found = driven(fmu, times, signals, list(expected))
    for name, values in expected.items():
        scale = max(1.0, float(np.abs(values).max()))
        assert np.abs(found[name] - values).max() < 2e-3 * scale, name
        assert np.abs(found[name][-1] - values[-1]) < 1e-5 * scale, name


def driven(
    fmu: Path, times: Floats, signals: Mapping[str, Floats], names: Sequence[str]
) -> dict[str, Floats]:
    """Outputs at the times, of an FMU whose inputs follow cubic splines, told by values and derivatives.

    Halfway the state is saved, run over and restored: that leaves no trace.
    """
    unzipped = fmpy.extract(str(fmu), unzipdir=str(fmu.with_suffix("")))
    description = fmpy.read_model_description(str(fmu), validate=False)
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=unzipped,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="driven",
    )
    variables = {each.name: each.valueReference for each in description.modelVariables}
    splines = {
        name: CubicHermiteSpline(times, values, np.gradient(values, times, edge_order=2))
        for name, values in signals.items()
    }

    def tell(t: float) -> None:
        for name, spline in splines.items():
            slave.setReal([variables[name]], [float(spline(t))])
            for order in (1, 2, 3):
                slave.setRealInputDerivatives([variables[name]], [order], [float(spline(t, order))])

    slave.instantiate()
    slave.setupExperiment(tolerance=1e-9, startTime=0.0)
    slave.enterInitializationMode()
    slave.setReal([variables[name] for name in signals], [float(values[0]) for values in signals.values()])
    references = [variables[name] for name in names]
    first = slave.getReal(references)
    slave.exitInitializationMode()
    rows = [slave.getReal(references)]
    assert rows[0] == first
    for k, t in enumerate(times[:-1]):
        tell(float(t))
        saved = slave.getFMUState() if k == len(times) // 2 else None
        slave.doStep(float(t), float(times[k + 1] - t))
        rows.append(slave.getReal(references))
        if saved is not None:
            slave.doStep(float(times[k + 1]), 0.3)
            slave.setFMUState(saved)
            slave.freeFMUState(saved)
            slave.doStep(float(t), float(times[k + 1] - t))
            assert slave.getReal(references) == rows[-1]
    slave.terminate()
    slave.freeInstance()
    return dict(zip(names, np.array(rows).T, strict=True))


def test_directional_derivatives_know_the_new_inputs(tmp_path: Path) -> None:
    """u and the rates of an external player and of a part, along each input, against differences."""
    for fmu, extra in (
        (build_fmu(written(tmp_path, external(GAME, "beta")), tmp_path / "external.fmu"), 0.0),
        (build_part(written(tmp_path, GAME), [1], tmp_path / "part.fmu"), 0.3),
    ):
        coupled = Coupled([fmu], tmp_path / fmu.stem)
        model, description, *_ = coupled.parts[0]
        inputs = [each.valueReference for each in description.modelVariables if each.causality == "input"]
        outputs = [each.valueReference for each in description.modelVariables if each.name.startswith("u[")]
        derivatives = [each.variable.valueReference for each in description.derivatives]
        unknowns = [*outputs, *derivatives]
        base = np.linspace(-1.0, 1.0, len(inputs)) + extra
        listed = {
            each.variable.valueReference: each for each in [*description.outputs, *description.derivatives]
        }

        def values(at: Floats) -> Floats:
            model.setReal(inputs, at.tolist())  # noqa: B023
            return np.array(model.getReal(unknowns))  # noqa: B023

        for k, known in enumerate(inputs):
            h = 1e-5 * (np.arange(len(inputs)) == k)
            difference = (values(base + h) - values(base - h)) / 2e-5
            values(base)
            exact = np.array(model.getDirectionalDerivative(unknowns, [known], [1.0]))
            np.testing.assert_allclose(
                exact, difference, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(exact).max())
            )
            for unknown, change in zip(unknowns, exact, strict=True):
                depends = known in {each.valueReference for each in listed[unknown].dependencies}
                assert depends or change == 0.0, (unknown, known)
        coupled.free()


def test_the_paper_s_example_is_taken_apart(tmp_path: Path) -> None:
    fmu = build_part(shipped_game("five_vehicles"), [4, 5], tmp_path / "part.fmu")
    model = read_model(fmu)
    assert model.elsewhere == (1, 2, 3)
    assert model.external == ()
    assert model.player_names[3] == "vehicle 4"
    assert {name[:6] for name in model.variables if name.startswith("xbar[")} == {
        "xbar[1",
        "xbar[3",
        "xbar[4",
        "xbar[5",
    }
