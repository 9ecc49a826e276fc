"""What the package imports: nothing in a circle, nothing heavy for --help, extras told by their names."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest
from typer.testing import CliRunner

import mixed_order_game as mog
from mixed_order_game.cli.app import app
from mixed_order_game.errors import MissingPackageError
from mixed_order_game.extras import EXTRAS

SOURCES = Path(__file__).resolve().parents[2] / "python_harness"
HEAVY = {"numpy", "scipy", "fmpy", "lxml", "matplotlib", "networkx", "pyarrow", "jsonschema"}


def modules() -> dict[str, Path]:
    named = {}
    for path in sorted((SOURCES / "mixed_order_game").rglob("*.py")):
        parts = path.relative_to(SOURCES).with_suffix("").parts
        named[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return named


def imported(name: str, path: Path, known: dict[str, Path]) -> Iterator[str]:
    """Modules of the package that a module imports anywhere, for checkers of types alone apart."""
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {
        node
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level and node not in for_types:
            base = package[: len(package) - node.level + 1] + (node.module.split(".") if node.module else [])
            for alias in node.names:
                found = ".".join([*base, alias.name])
                yield found if found in known else ".".join(base)


def test_no_import_goes_in_a_circle() -> None:
    known = modules()
    graph = nx.DiGraph((name, other) for name, path in known.items() for other in imported(name, path, known))
    assert graph.number_of_edges() > 300
    assert list(nx.simple_cycles(graph)) == []


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["sweep", "--help"], ["check", "--help"]])
def test_help_and_version_import_nothing_heavy(arguments: list[str]) -> None:
    script = (
        "import sys; from mog_command import main\n"
        f"sys.argv = ['mog', *{arguments!r}]\n"
        "try: main()\n"
        f"finally: print({{name.split('.')[0] for name in sys.modules}} & {HEAVY!r}, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stderr == "set()\n"


@pytest.mark.parametrize(
    ("statement", "unwanted"),
    [
        ("import mixed_order_game.studies.pool", {"asyncio", "importlib.metadata", "pyarrow", "scipy"}),
        (
            "import mixed_order_game.cli.tables; import mixed_order_game as mog; mog.run(stop_time=0.1)",
            {"numpy.ma", "pyarrow", "rich.markdown", "scipy"},
        ),
    ],
    ids=["worker of a sweep", "run"],
)
def test_what_runs_imports_only_what_it_needs(statement: str, unwanted: set[str]) -> None:
    script = f"import sys; {statement}; print(sorted(sys.modules.keys() & {unwanted!r}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_every_public_name_is_there() -> None:
    assert {"Game", "Result", "run", "validate", "analyse", "sweep", "report"} <= set(dir(mog))
    for name in dir(mog):
        assert getattr(mog, name) is not None


@pytest.mark.parametrize("package", EXTRAS)
def test_a_missing_package_is_told_with_its_extra(
    package: str, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet, bad = tmp_path / "run.parquet", tmp_path / "bad.toml"
    result = mog.run(fmu, stop_time=0.1, outputs=["x"])
    bad.write_text("dimension = 0\n", encoding="utf-8")
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, package, None)
    for part in ("offline", "converter"):
        monkeypatch.setitem(sys.modules, f"{package}.{part}", None)
    told = f'pip install "mixed-order-game[{EXTRAS[package]}]"'
    if package == "sympy":
        with pytest.raises(MissingPackageError, match="this needs sympy: pip install"):
            mog.Game().set_cost(1, lambda x: x[1, 1] ** 2)
        return
    if package in ("pandas", "xarray"):
        with pytest.raises(MissingPackageError, match=f"this needs {package}: pip install"):
            getattr(result, f"to_{package}")()
        return
    command = {
        "pyarrow": ["run", fmu, "--stop-time", "0.1", "--output", parquet],
        "jsonschema": ["check", bad],
        "bokeh": ["explore", fmu, "--no-browser"],
        "tornado": ["explore", fmu, "--no-browser"],
        "jinja2": ["report", fmu, "--output", tmp_path / "a.html"],
        "latex2mathml": ["report", fmu, "--output", tmp_path / "a.html"],
        "matplotlib": ["plot", fmu, "--output", tmp_path],
        "plotly": ["report", fmu, "--output", tmp_path / "a.html"],
        "distributed": [
            "sweep",
            fmu,
            "--grid",
            "k1=1",
            "--output",
            tmp_path / "s",
            "--scheduler",
            "tcp://a:1",
        ],
    }[package]
    done = CliRunner().invoke(app, [str(each) for each in command])
    assert (done.exit_code, done.stdout) == (1, "")
    assert told in done.stderr
    if package == "jsonschema":
        assert done.stderr.splitlines()[0] == f"{bad}:1:1: title is missing, expected text"
