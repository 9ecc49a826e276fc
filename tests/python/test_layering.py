"""Who may include what: one way from the FMI functions down to the core."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SUFFIXES = {".cpp", ".hpp", ".ipp", ".h", ".c"}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)


def sources(folder: str) -> Iterator[Path]:
    return (path for path in sorted((ROOT / folder).rglob("*")) if path.suffix in SUFFIXES)


def includes(path: Path) -> list[str]:
    return INCLUDE.findall(path.read_text(encoding="utf-8"))


def code(path: Path) -> str:
    """Text without comments and string literals."""
    text = path.read_text(encoding="utf-8")
    pattern = r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"'
    return re.sub(pattern, " ", text, flags=re.DOTALL)


def named(paths: Iterator[Path]) -> list[object]:
    return [pytest.param(path, id=str(path.relative_to(ROOT))) for path in paths]


@pytest.mark.parametrize("path", named(sources("core")))
def test_core_knows_no_input_output_and_nothing_above_it(path: Path) -> None:
    forbidden = re.compile(r"(iostream|filesystem|fmi\w*\.h|fmu_src/.*)$")
    assert [name for name in includes(path) if forbidden.search(name)] == []
    above = {header.name for header in sources("fmu_src")} - {header.name for header in sources("core")}
    assert [name for name in includes(path) if Path(name).name in above] == []
    calls = re.findall(r"\b(?:printf|fprintf|puts|fopen|getenv|setenv|abort|assert|exit)\s*\(", code(path))
    assert calls == []
    assert re.findall(r"\bstd::(?:cout|cerr|clog)\b", code(path)) == []


@pytest.mark.parametrize("path", named(path for folder in ("core", "fmu_src") for path in sources(folder)))
def test_only_the_integrator_knows_sundials(path: Path) -> None:
    allowed = path.stem.startswith(("integrator", "sundials"))
    solver = re.compile(r"^(cvodes?|arkode|ida|kinsol|nvector|sunlinsol|sunmatrix|sunnonlinsol|sundials)/")
    assert allowed or [name for name in includes(path) if solver.search(name)] == []


VERSION_ROOM = re.compile(r"fmu_src/fmi(\d)/")


@pytest.mark.parametrize("path", named(path for folder in ("core", "fmu_src") for path in sources(folder)))
def test_only_the_room_of_a_version_of_fmi_knows_it(path: Path) -> None:
    room = VERSION_ROOM.search(path.as_posix())
    rooms = [room for room in (ROOT / "fmu_src").iterdir() if re.fullmatch(r"fmi\d", room.name)]
    if room:
        versions = re.findall(r"\bfmi(\d)", " ".join(includes(path)))
        assert set(versions) <= {room[1]}
        others = [
            header.name for other in rooms if other.name != f"fmi{room[1]}" for header in other.glob("*.hpp")
        ]
    else:
        assert [name for name in includes(path) if re.match(r"fmi\d\w*\.h$", name)] == []
        assert re.findall(r"\bfmi\d\w*", code(path)) == []
        others = [header.name for other in rooms for header in other.glob("*.hpp")]
    assert [name for name in includes(path) if Path(name).name in others] == []


def test_the_python_package_imports_packaging_from_the_standard_library_alone() -> None:
    text = (ROOT / "python_harness/mixed_order_game/fmu/packaging.py").read_text(encoding="utf-8")
    modules = set(re.findall(r"^(?:from|import) (\S+)", text, re.MULTILINE))
    assert modules <= {"argparse", "collections.abc", "os", "pathlib", "re", "sys", "tempfile", "zipfile"}
