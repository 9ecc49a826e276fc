"""Help of every command on narrow and wide terminals: nothing is cut, no Python type is named."""

import os
import re
import subprocess
import sys
from copy import copy
from typing import Any

import pytest
import typer.main
from rich.text import Text

from mixed_order_game.cli.app import app

ROOT: Any = typer.main.get_command(app)
COMMANDS: dict[str, Any] = {"": ROOT, **ROOT.commands}


def words(text: str) -> set[str]:
    """Words of a text; lines are also broken at hyphens."""
    return set(re.findall(r"[^\s\-]+", text))


@pytest.mark.parametrize("width", [60, 80])
@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_cut(
    name: str, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    copy(COMMANDS[name]).main(["--help"], prog_name=f"mog {name}", standalone_mode=False)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    assert not re.search(r"<(list|path|int|float|str)\b", text)
    assert words(Text.from_markup(COMMANDS[name].help).plain) <= words(text)
    for each in COMMANDS[name].params:
        assert words(each.help or "") <= words(text)
        for option in (*each.opts, *each.secondary_opts) if each.param_type_name == "option" else ():
            assert re.search(rf"(?<![\w-]){option}(?![\w-])", text), option
        if each.param_type_name == "option":
            assert words(each.metavar or "") <= words(text)


def test_lists_of_commands_cut_no_sentence() -> None:
    for name, command in ROOT.commands.items():
        assert command.get_short_help_str() == command.help.partition("\n\n")[0], name


def test_where_the_console_has_few_characters() -> None:
    environment = os.environ | {"COLUMNS": "80", "LC_ALL": "C", "PYTHONIOENCODING": "latin-1"}
    command = [sys.executable, "-m", "mixed_order_game", "run", "--help"]
    done = subprocess.run(command, capture_output=True, check=True, env=environment)
    assert done.stderr == b""
    assert done.stdout.isascii()
    assert b"+- Arguments -" in done.stdout
