"""The pages on games, reports, importers and theory: what they show runs, and what they name exists."""

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mixed_order_game import default_fmu, read_model
from mixed_order_game.cli.app import app
from mixed_order_game.reporting.fmu_reference import fmu_reference, main
from tests.vehicle.make import make_vehicle

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "python_harness" / "docs"


def text_of(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def blocks(page: str) -> Iterator[tuple[str, str]]:
    """Language and content of every block, in their order."""
    yield from re.findall(r"^```(\w+)\n(.*?)^```", text_of(page), re.MULTILINE | re.DOTALL)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run_page(page: str) -> None:
    """Run every command line and every snippet, one after the other, in one folder and one namespace."""
    namespace: dict[str, object] = {}
    for language, content in blocks(page):
        if "import casadi" in content:
            continue  # ./dev compliance runs it
        if language == "console":
            for line in content.splitlines():
                run_line(line)
        elif language == "python":
            exec(compile(content, page, "exec"), namespace)  # noqa: S102 - our own documentation
        else:
            assert language in ("text", "toml", "c")


def run_line(line: str) -> None:
    name, *arguments = shlex.split(line)
    if name == "mog":
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, f"{line}: {done.output}"
        return
    program = shutil.which(name, path=str(Path(sys.executable).parent))
    assert program is not None, f"{name} of {line} is not installed"
    finished = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, f"{line}: {finished.stdout}{finished.stderr}"


@pytest.mark.parametrize("page", ["games.md", "report.md"])
def test_pages_of_commands(page: str) -> None:
    run_page(page)


def test_importers() -> None:
    pytest.importorskip("libcosimpy.CosimExecution", reason="libcosimpy exists for x86_64 only")
    run_page("importers.md")


@pytest.mark.skipif(shutil.which("cc") is None, reason="the vehicle is compiled")
def test_a_plant_of_one_s_own() -> None:
    pytest.importorskip("libcosimpy.CosimExecution", reason="libcosimpy exists for x86_64 only")
    make_vehicle(Path("vehicle.fmu"))
    run_page("own_plant.md")
    shown = next(content for language, content in blocks("own_plant.md") if language == "c")
    assert shown in (ROOT / "tests/vehicle/vehicle.c").read_text(encoding="utf-8")


def test_what_is_not_run_is_marked() -> None:
    sections = re.split(r"^## ", text_of("importers.md"), flags=re.MULTILINE)[1:]
    assert {section.splitlines()[0] for section in sections} == {
        "FMPy",
        "libcosim",
        "CasADi",
        "OMSimulator",
        "OpenModelica",
        "Dymola",
        "Simulink",
    }
    for section in sections:
        runs = "```console" in section or "```python" in section
        assert runs is not ("*Not run*" in section)
        assert ("import casadi" in section) is ("*Run by `./dev compliance`*" in section)


@pytest.mark.parametrize(
    "page", ["games.md", "report.md", "importers.md", "own_plant.md", "theory_to_code.md"]
)
def test_links_lead_somewhere(page: str) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", text_of(page)):
        assert target.startswith("https://") or (DOCS / target).exists(), target


def test_the_map_of_the_theory_names_code_that_exists() -> None:
    named = re.findall(r"`([\w/]+\.(?:cpp|hpp|ipp|py))` `(\w+)`", text_of("theory_to_code.md"))
    assert len(named) > 50
    for path, name in named:
        assert re.search(rf"\b{name}\b", (ROOT / path).read_text(encoding="utf-8")), f"{path} {name}"


def test_the_map_of_the_theory_names_every_equation_of_the_oracle() -> None:
    """The oracle transcribes the paper equation by equation: a map that names all of it is complete."""
    oracle = (ROOT / "tests/oracle/paper_equations.py").read_text(encoding="utf-8")
    functions = set(re.findall(r"^def (\w+)", oracle, re.MULTILINE))
    same_in_the_map = {
        "pseudo_gradient",  # gradient_at_estimates with every estimate right
        "seeking_error_first_order",  # one row for both orders
        "plain_control_first_order",
    }
    page = text_of("theory_to_code.md")
    assert {name for name in functions if f"`{name}`" not in page} <= same_in_the_map


def test_the_reference_is_that_of_the_fmu(capsys: pytest.CaptureFixture[str]) -> None:
    """If it is not, write the output of python -m mixed_order_game.reporting.fmu_reference to it."""
    assert text_of("fmu_reference.md") == fmu_reference(read_model(default_fmu()))
    assert main([]) == 0
    assert capsys.readouterr().out == text_of("fmu_reference.md")


def test_the_reference_tells_every_variable() -> None:
    model = read_model(default_fmu())
    counts = [
        int(count)
        for count in re.findall(r"^\| `[^`]+` \| (\d+) \|", text_of("fmu_reference.md"), re.MULTILINE)
    ]
    assert sum(counts) == len(model.variables)


def test_the_reference_command_fails_in_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["none.fmu"]) == 1
    assert capsys.readouterr().err == "fmu_reference: there is no FMU none.fmu\n"
    assert main(["one.fmu", "two.fmu"]) == 2
    assert capsys.readouterr().err.startswith("usage: ")
