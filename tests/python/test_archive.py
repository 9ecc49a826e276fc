"""The archive and its binary: valid, complete, reproducible; exports FMI alone and needs libc alone."""

import io
import re
import zipfile
from pathlib import Path
from typing import Any, cast

import fmpy
import pytest
from elftools.elf.elffile import ELFFile
from fmpy.validation import validate_fmu

from mixed_order_game import build_fmu, default_game
from tests.conftest import GAMES, FmuOf

BINARY = "binaries/linux64/MixedOrderGame.so"
NEEDED = re.compile(r"(libc|libm|ld-linux[\w-]*)\.so\.\d+")
FMI2 = Path(str(fmpy.__file__)).parent / "c-code" / "fmi2Functions.h"


@pytest.fixture(scope="module")
def binary(fmu: Path) -> ELFFile:
    with zipfile.ZipFile(fmu) as archive:
        return ELFFile(io.BytesIO(archive.read(BINARY)))


@pytest.mark.parametrize("name", ["five_vehicles", *sorted(path.stem for path in GAMES.glob("*.toml"))])
def test_fmpy_finds_nothing(name: str, fmu_of: FmuOf) -> None:
    assert validate_fmu(str(fmu_of(name))) == []


def test_exports_every_fmi_function_and_nothing_else(binary: ELFFile) -> None:
    symbols = cast("Any", binary.get_section_by_name(".dynsym")).iter_symbols()
    exported = {
        symbol.name
        for symbol in symbols
        if symbol["st_shndx"] != "SHN_UNDEF" and symbol["st_info"]["bind"] in ("STB_GLOBAL", "STB_WEAK")
    }
    declared = set(re.findall(r"\bFMI2_Export\s+\w+\s+(fmi2\w+)\s*;", FMI2.read_text()))
    assert len(declared) > 40
    assert exported == declared


def test_needs_only_the_c_library(binary: ELFFile) -> None:
    tags = cast("Any", binary.get_section_by_name(".dynamic")).iter_tags()
    needed = [tag.needed for tag in tags if tag.entry.d_tag == "DT_NEEDED"]
    assert [name for name in needed if not NEEDED.fullmatch(name)] == []


def test_every_game_shares_the_binary(fmu_of: FmuOf) -> None:
    contents = []
    for name in ("five_vehicles", "two_scalar_players"):
        with zipfile.ZipFile(fmu_of(name)) as archive:
            contents.append(archive.read(BINARY))
    assert contents[0] == contents[1]


def test_paths_of_the_archive(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        for entry in archive.infolist():
            assert "\\" not in entry.orig_filename
            assert not entry.is_dir()
            assert entry.compress_type == zipfile.ZIP_DEFLATED


def test_reproducible_bytes(fmu: Path, tmp_path: Path) -> None:
    again = build_fmu(default_game(), tmp_path / "again.fmu")
    assert again.read_bytes() == fmu.read_bytes()


def test_members(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        assert archive.read("resources/game.toml") == default_game().read_bytes()
        assert archive.read("model.png").startswith(b"\x89PNG\r\n\x1a\n")
        page = archive.read("documentation/index.html").decode()
    for name in ("modelDescription.xml", BINARY):
        assert name in names
    for word in ("Equations", "Variables", "fmi2Error", "logStatusError", "documentation/licenses", "extra/"):
        assert word in page, word
    assert re.findall(r'(?:src|href)="(?!#)([^"]+)"', page) == [], "nothing outside the page is needed"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mixed-order-game", "Redistribution and use"),
        ("sundials", "Lawrence Livermore National Security"),
        ("eigen", "Mozilla Public License"),
        ("tomlplusplus", "Mark Gillard"),
        ("pegtl", "Colin Hirsch"),
        ("libstdc++", "GCC RUNTIME LIBRARY EXCEPTION"),
    ],
)
def test_licence_of_everything_linked_in(name: str, words: str, fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read(f"documentation/licenses/{name}.txt").decode(errors="replace")
    assert words.lower() in re.sub(r"\s+", " ", text).lower()


def test_types_units_ranges_and_categories(fmu: Path) -> None:
    description = fmpy.read_model_description(str(fmu))
    types = {each.name: each for each in description.typeDefinitions}
    units = {each.name for each in description.unitDefinitions}
    variables = description.modelVariables
    assert {each.declaredType.name for each in variables if each.declaredType is not None} == set(types)
    assert {each.unit for each in variables if each.unit} <= units
    for family in ("x", "v", "u", "z", "y", "W", "k1", "d_ext"):
        first = next(each for each in variables if each.name.partition("[")[0] == family)
        assert first.unit or first.declaredType.unit, family
    assert next(each for each in variables if each.name == "k1").min is not None
    assert [category.name for category in description.logCategories] == [
        "logStatusError",
        "logStatusDiscard",
        "logEvents",
        "logAll",
    ]


def test_default_experiment_has_at_most_a_thousand_points(fmu: Path) -> None:
    experiment = fmpy.read_model_description(str(fmu)).defaultExperiment
    assert float(experiment.stopTime) / float(experiment.stepSize) <= 1000.0
    assert float(experiment.tolerance) == 1e-6
