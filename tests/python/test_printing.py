"""Tables on narrow terminals and where there is no terminal: every word of every cell is there."""

import io
import re
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table
from rich.text import Text
from typer.testing import CliRunner

from mixed_order_game.cli import app as cli
from mixed_order_game.cli.printing import show, standard_output

HEADER = ("run", "settling time (s)", "control energy", "final error", "meaning")
ROWS = (
    (
        "as it is",
        "0.594",
        "2.48e+05",
        "0.000123",
        "the longest text of all, with commas and a dozen words in it",
    ),
    ("without network", "-", "1.5e+03", "12345.678", "short"),
)


def printed(width: int) -> str:
    console = Console(width=width, file=io.StringIO(), color_system=None, highlight=False)
    table = Table(*HEADER, title=Text("title of the table"))
    for row in ROWS:
        table.add_row(*map(Text, row))
    show(table, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [12, 20, 40, 55, 70, 100, 1000])
def test_no_word_is_lost(width: int) -> None:
    text = printed(width)
    assert max(map(len, text.splitlines())) <= width
    assert not re.search(" +$", text, re.MULTILINE)
    assert "…" not in text
    words = set(re.findall(r"[\w.+-]+", text))
    if width >= 40:  # a line for each column needs room for two words
        assert set(re.findall(r"[\w.+-]+", " ".join([*HEADER, *ROWS[0], *ROWS[1]]))) <= words


@pytest.mark.parametrize("command", [["compare", "--no-baselines"], ["run"], ["info", "--variables"]])
def test_where_there_is_no_terminal_lines_are_whole(command: list[str], fmu: Path) -> None:
    name, *options = command
    stop = [] if name == "info" else ["--stop-time", "0.1"]
    done = CliRunner(env={"COLUMNS": "30"}).invoke(cli.app, [name, str(fmu), *options, *stop])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert [line for line in lines if line.endswith(" ")] == []
    expected = {
        "compare": r"run +settling time \(s\) +overshoot +control energy +control peak +final error +events",
        "run": r"  5 +-?[\d.]+, -?[\d.]+ +-?[\d.]+, -?[\d.]+ +-0.5, -0.5 +[\d.e+-]+",
        "info": rf"fmu +{re.escape(str(fmu))}",
    }
    assert any(
        re.fullmatch(expected[name], line) or re.fullmatch(expected[name], line.strip()) for line in lines
    )
    assert "…" not in done.stdout


@pytest.mark.parametrize("width", [30, 60])
def test_narrow_terminals(width: int, fmu: Path) -> None:
    terminal = {"COLUMNS": str(width), "FORCE_COLOR": "1", "NO_COLOR": "1", "TERM": "xterm"}
    done = CliRunner(env=terminal).invoke(cli.app, ["compare", str(fmu), "--stop-time", "0.1"])
    text = re.sub(r"\x1b\[[\d;]*m", "", done.stdout)
    assert max(map(len, text.splitlines())) <= width
    assert text.count("final error") == text.count("events") == 4  # row by row
    assert "without network" in text


def test_width_of_standard_output(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    assert standard_output().width > 10_000
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert standard_output().width == 60
