"""The archive and its binary: valid for fmpy, FMI functions and nothing else exported, only libc needed."""

import io
import re
import zipfile
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile
from fmpy.validation import validate_fmu

from tests.conftest import GAMES, FmuOf

BINARY = "binaries/linux64/MixedOrderGame.so"
NEEDED = re.compile(r"(libc|libm|ld-linux[\w-]*)\.so\.\d+")
FMI2 = Path(__import__("fmpy").__file__).parent / "c-code" / "fmi2Functions.h"


@pytest.fixture(scope="module")
def binary(fmu: Path) -> ELFFile:
    with zipfile.ZipFile(fmu) as archive:
        return ELFFile(io.BytesIO(archive.read(BINARY)))


@pytest.mark.parametrize("name", ["five_vehicles", *sorted(path.stem for path in GAMES.glob("*.toml"))])
def test_fmpy_finds_nothing(name: str, fmu_of: FmuOf) -> None:
    assert validate_fmu(str(fmu_of(name))) == []


def test_exports_every_fmi_function_and_nothing_else(binary: ELFFile) -> None:
    symbols = binary.get_section_by_name(".dynsym").iter_symbols()
    exported = {
        symbol.name
        for symbol in symbols
        if symbol["st_shndx"] != "SHN_UNDEF" and symbol["st_info"]["bind"] in ("STB_GLOBAL", "STB_WEAK")
    }
    declared = set(re.findall(r"\bFMI2_Export\s+\w+\s+(fmi2\w+)\s*;", FMI2.read_text()))
    assert len(declared) > 40
    assert exported == declared


def test_needs_only_the_c_library(binary: ELFFile) -> None:
    tags = binary.get_section_by_name(".dynamic").iter_tags()
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
