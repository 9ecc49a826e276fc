"""FMUs of some of a game's players, and system structures (SSP 1.0) that connect them along the graph."""

import shutil
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BuildError, GameError, ResultError
from ..files.reading import ReadError, expect_file, read_text, toml_of
from ..files.temporary import temporary_folder
from ..files.writing import FMU, SSP, check_output, write_file
from ..game.parts import part_of_game, toml_of_game
from ..version import package_version
from .build import build_fmu, game_file
from .model import Model, Variable, read_model
from .packaging import PackagingError, write_archive

EXTERNAL_STEP = 0.2784645427610738
"""K = exp(-(K + 1)) of the robust term."""

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"

UNITS: Mapping[str, Mapping[str, int]] = {
    "1": {}, "s": {"s": 1}, "1/s": {"s": -1}, "1/s2": {"s": -2}, "1/s3": {"s": -3}, "1/s4": {"s": -4},
    "rad/s": {"s": -1, "rad": 1}, "rad": {"rad": 1},
}  # fmt: skip
"""Units of the FMUs as powers of base units, as their modelDescription.xml defines them."""


def build_part(
    game: Path | str,
    players: Collection[int],
    output: Path | str,
    *,
    arm_linux: bool | None = None,
    force: bool = False,
) -> Path:
    """Make the FMU of some players of a game, 1-based; return `output`.

    It holds their plants, laws and estimates; what it needs of the others are inputs, and what they hear of
    it are outputs. Its resources/game.toml says nothing of the others' costs, dynamics and disturbances.
    Raises GameError for a game or players that are not valid, BuildError as build_fmu does.
    """
    source = game_file(game)
    part = _part(source, players)
    try:
        check_output(output, FMU, inputs=[source], force=force)
    except ResultError as error:
        raise BuildError(str(error)) from error
    with temporary_folder(BuildError) as folder:
        return build_fmu(_written(part, folder), output, arm_linux=arm_linux, force=force)


def build_ssp(
    game: Path | str,
    output: Path | str,
    *,
    groups: Iterable[Collection[int]] | None = None,
    force: bool = False,
) -> Path:
    """Make a system structure (SSP 1.0) of a game: one FMU a player, or one for each group; return `output`.

    Groups hold 1-based players, each player in one of them. The FMUs are connected along the graph and where
    dynamics depend on others; connectors of external plants stay open, external disturbances have none.
    Parameters lie in one .ssv file for each FMU.
    Raises GameError for a game or groups that are not valid, BuildError as build_fmu does.
    """
    source = game_file(game)
    count = len(_tables(source)["player"])
    chosen = [sorted(set(group)) for group in groups] if groups is not None else []
    if groups is None:
        chosen = [[number] for number in range(1, count + 1)]
    elif sorted(number for group in chosen for number in group) != list(range(1, count + 1)):
        raise GameError(f"the groups are {chosen}, expected each player from 1 to {count} in one of them")
    try:
        check_output(output, SSP, inputs=[source], force=force)
    except ResultError as error:
        raise BuildError(str(error)) from error
    with temporary_folder(BuildError) as folder:
        components = []
        for group in chosen:
            name = _name(group)
            fmu = build_part(source, group, folder / f"{name}.fmu")
            components.append(_Component(name, tuple(group), read_model(fmu)))
        entries = {f"resources/{each.name}.fmu": folder / f"{each.name}.fmu" for each in components}
        files = {"SystemStructure.ssd": _structure(components)}
        files |= {f"resources/{each.name}.ssv": _parameters(each) for each in components}
        for member, root in files.items():
            path = folder / Path(member).name
            ET.indent(root)
            path.write_bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))
            entries[member] = path
        archive = folder / "made.ssp"
        try:
            write_archive(archive, entries)
            with archive.open("rb") as made:
                return write_file(
                    Path(output),
                    SSP,
                    lambda file: shutil.copyfileobj(made, file),
                    inputs=[source],
                    force=force,
                )
        except (PackagingError, ResultError) as error:
            raise BuildError(f"cannot make {output}: {error}") from error


def longest_sampled_step(model: Model) -> dict[int, float]:
    """Bound of the communication step, s, for a stable loop through each external plant, by 1-based player.

    2 / (k + K delta^2 / epsilon) with k = k1 (order 1) or k4 (order 2): a sampled loop with this gain, whose
    plant steps after the law. Where both step at once, u is a step older, and the bound is half of this.
    """
    return {
        number: 2.0 / (gains["k"] + EXTERNAL_STEP * gains["delta"] ** 2 / gains["epsilon"])
        for number, player in enumerate(model.game["player"], 1)
        if player.get("plant") == "external"
        for gains in [_gains(model, player)]
    }


def notes_of_parts(model: Model) -> list[str]:
    """What a user of an FMU with external plants has to know about its communication step."""
    return [
        f"player {number}: the loop through the external plant is stable only for communication steps below "
        f"{0.5 * step:.2g} s where all FMUs step at once, {step:.2g} s where the plant steps after this one"
        for number, step in longest_sampled_step(model).items()
    ]


def _gains(model: Model, player: Mapping[str, Any]) -> dict[str, float]:
    gains = {**model.game["gains"], **player.get("gains", {})}
    robust = model.game.get("strategy", {}).get("robust", True)
    return {
        "k": float(gains["k1" if player["order"] == 1 else "k4"]),
        "delta": float(gains["delta"]) if robust else 0.0,
        "epsilon": float(gains["epsilon"]),
    }


@dataclass(frozen=True)
class _Component:
    name: str
    players: tuple[int, ...]
    model: Model

    def of(self, *causalities: str) -> list[Variable]:
        return [each for each in self.model.variables.values() if each.causality in causalities]

    @property
    def parameters(self) -> list[Variable]:
        """What a .ssv file sets: everything but the initial estimates, of which there are many."""
        return [each for each in self.of("parameter") if not each.name.startswith("y0[")]


def _name(group: Sequence[int]) -> str:
    return ("player_" if len(group) == 1 else "players_") + "_".join(map(str, group))


def _tables(game: Path) -> dict[str, Any]:
    expect_file(game, "game file", GameError)
    try:
        return toml_of(read_text(game))
    except ReadError as error:
        raise GameError(f"{game} cannot be read: {error}") from error


def _part(game: Path, players: Collection[int]) -> dict[str, Any]:
    """The tables of a part; the whole game is judged first, so that errors speak of its file."""
    from ..game.check import check_game

    problems = check_game(game)
    if problems:
        raise GameError(f"{game}:{problems[0].line}: {problems[0].sentence}")
    return part_of_game(_tables(game), players)


def _written(tables: Mapping[str, Any], folder: Path) -> Path:
    game = folder / "game.toml"
    game.write_text(toml_of_game(tables), encoding="utf-8")
    return game


def _structure(components: Sequence[_Component]) -> ET.Element:
    for prefix, uri in (("ssd", SSD), ("ssc", SSC), ("ssv", SSV)):
        ET.register_namespace(prefix, uri)
    model = components[0].model
    root = ET.Element(
        f"{{{SSD}}}SystemStructureDescription",
        {"version": "1.0", "name": "game", "generationTool": f"mixed-order-game {package_version()}"},
    )
    system = ET.SubElement(root, f"{{{SSD}}}System", {"name": "game"})
    elements = ET.SubElement(system, f"{{{SSD}}}Elements")
    for component in components:
        _add_component(elements, component)
    connections = ET.SubElement(system, f"{{{SSD}}}Connections")
    source = {variable.name: each for each in components for variable in each.of("output")}
    for component in components:
        for variable in component.of("input"):
            if (start := source.get(variable.name)) is None:
                continue
            ET.SubElement(
                connections,
                f"{{{SSD}}}Connection",
                {
                    "startElement": start.name,
                    "startConnector": variable.name,
                    "endElement": component.name,
                    "endConnector": variable.name,
                },
            )
    _add_units(
        root, SSD, {each.unit for component in components for each in component.model.variables.values()}
    )
    ET.SubElement(
        root, f"{{{SSD}}}DefaultExperiment", {"startTime": "0.0", "stopTime": repr(model.stop_time)}
    )
    return root


def _add_component(elements: ET.Element, component: _Component) -> None:
    node = ET.SubElement(
        elements,
        f"{{{SSD}}}Component",
        {
            "name": component.name,
            "type": "application/x-fmu-sharedlibrary",
            "source": f"resources/{component.name}.fmu",
        },
    )
    connectors = ET.SubElement(node, f"{{{SSD}}}Connectors")
    # tools expect every input to be connected, which external disturbances are not
    signals = [each for each in component.of("input", "output") if not each.name.startswith("d_ext[")]
    for variable in [*signals, *component.parameters]:
        connector = ET.SubElement(
            connectors, f"{{{SSD}}}Connector", {"name": variable.name, "kind": variable.causality}
        )
        unit = {"unit": variable.unit} if variable.unit else {}
        ET.SubElement(connector, f"{{{SSC}}}{variable.type}", unit)
    bindings = ET.SubElement(node, f"{{{SSD}}}ParameterBindings")
    ET.SubElement(
        bindings,
        f"{{{SSD}}}ParameterBinding",
        {"type": "application/x-ssp-parameter-set", "source": f"resources/{component.name}.ssv"},
    )


def _parameters(component: _Component) -> ET.Element:
    root = ET.Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": component.name})
    parameters = ET.SubElement(root, f"{{{SSV}}}Parameters")
    for variable in component.parameters:
        node = ET.SubElement(parameters, f"{{{SSV}}}Parameter", {"name": variable.name})
        value = str(variable.start).lower() if variable.type == "Boolean" else repr(variable.start)
        unit = {"unit": variable.unit} if variable.unit else {}
        ET.SubElement(node, f"{{{SSV}}}{variable.type}", {"value": value, **unit})
    _add_units(root, SSV, {each.unit for each in component.parameters})
    return root


def _add_units(root: ET.Element, namespace: str, names: Collection[str | None]) -> None:
    units = ET.SubElement(root, f"{{{namespace}}}Units")
    for name in sorted(name for name in names if name):
        unit = ET.SubElement(units, f"{{{SSC}}}Unit", {"name": name})
        powers = UNITS.get(name, {})
        ET.SubElement(unit, f"{{{SSC}}}BaseUnit", {base: str(power) for base, power in powers.items()})
