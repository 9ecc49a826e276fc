"""What the documentation shows runs as shown, in an empty folder."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mixed_order_game.cli.app import app

DOCS = Path(__file__).resolve().parents[2] / "python_harness" / "docs"


def blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")


def test_commands() -> None:
    lines = "".join(blocks("commands.md", "console")).splitlines()
    assert len(lines) >= 10
    for line in lines:
        name, *arguments = shlex.split(line)
        assert name == "mog"
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert Path("five_vehicles.fmu").is_file()
    assert Path("figures/plane.svg").is_file()


def test_python() -> None:
    namespace: dict[str, object] = {}
    for block in blocks("python.md", "python"):
        exec(compile(block, "python.md", "exec"), namespace)  # noqa: S102 - our own documentation
    errors = namespace["errors"]
    assert isinstance(errors, list)
    assert len(errors) == 3
    assert Path("plane.pdf").is_file()


def test_readme() -> None:
    """Its game, what it shows of the FMU and of Python, and command lines that are not run elsewhere."""
    text = (DOCS.parents[1] / "README.md").read_text(encoding="utf-8")
    assert CliRunner().invoke(app, ["build", "five_vehicles", "--output", "five_vehicles.fmu"]).exit_code == 0
    (game,) = re.findall(r"^```toml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    Path("my_game.toml").write_text(game, encoding="utf-8")
    for line in re.findall(r"^mog (?:build|run) .*", text, re.MULTILINE):
        result = CliRunner().invoke(app, shlex.split(line, comments=True)[1:])
        assert result.exit_code == 0, f"{line}: {result.output}"
    assert Path("run.csv").is_file()
    assert Path("my_game.fmu").is_file()
    for block in re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        exec(compile(block, "README.md", "exec"), {})  # noqa: S102 - our own documentation
    for target in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (DOCS.parents[1] / target).exists(), target


def test_every_command_is_described() -> None:
    text = (DOCS / "commands.md").read_text(encoding="utf-8")
    for command in app.registered_commands:
        assert command.callback is not None
        assert f"| `{command.callback.__name__}` |" in text
