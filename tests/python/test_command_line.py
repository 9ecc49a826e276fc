"""What all commands have in common: headings of options, completion, JSON, --verbose and --quiet."""

import json
import logging
from pathlib import Path
from typing import Any

import pytest
import typer.main
from typer.testing import CliRunner

from mixed_order_game import Game
from mixed_order_game.cli import completion, panels
from mixed_order_game.cli.app import app

COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def mog(*arguments: object) -> Any:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(each) for each in arguments])


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_every_option_stands_under_a_heading() -> None:
    options = {
        parameter.name: parameter.rich_help_panel
        for command in COMMANDS.values()
        for parameter in command.params
        if parameter.param_type_name == "option"
    }
    assert {name for name, heading in options.items() if heading is None} == {"verbose", "quiet"}
    named = [name for names in panels.PANELS.values() for name in names]
    assert len(named) == len(set(named))
    assert set(named) <= set(options)
    assert all(command.rich_help_panel for command in COMMANDS.values())
    told = mog("run", "--help").stdout
    assert all(f"─ {heading} ─" in told for heading in ("The game", "The run", "What is written"))


def test_commands_that_print_values_print_json() -> None:
    mog("new", "game.toml", "--players", "2", "--dimension", "1")
    Path("bad.toml").write_text("dimension = 0\n", encoding="utf-8")
    run = mog("run", "game.toml", "--stop-time", "0.1", "--json", "--output", "run.csv")
    told = json.loads(run.stdout)
    assert run.stderr == "run.csv\n"
    assert (told["samples"], [each["player"] for each in told["players"]]) == (6, [1, 2])
    assert None in [each["v"] for each in told["players"]]
    assert told["metrics"]["settling_time"] is None
    checked = mog("check", "game.toml", "bad.toml", "none.toml", "--json")
    assert checked.exit_code == 1
    good, bad, none = json.loads(checked.stdout)
    assert (good["valid"], good["problems"], good["equilibrium"]["is_affine"]) == (True, [], True)
    assert (bad["valid"], bad["problems"][0]["line"]) == (False, 1)
    assert none["problems"][0]["sentence"] == "there is no game file none.toml"
    page = mog("report", "run.csv", "--output", "page.html", "--json")
    assert json.loads(page.stdout) == {"page": "page.html", "validation": None}
    demo = mog("demo", "--fmu", "game.toml", "--output", "demo", "--json")
    assert {claim["name"] for claim in json.loads(demo.stdout)["claims"]} >= {"nash_equilibrium", "archive"}
    printing = {
        name for name, command in COMMANDS.items() if any(p.name == "as_json" for p in command.params)
    }
    # the others print names of files, an address, or JSON alone
    assert set(COMMANDS) - printing == {"build", "explore", "new", "plot", "schema", "ssp"}


def test_verbose_tells_what_is_done_and_quiet_nothing() -> None:
    command = ("run", "five_vehicles", "--stop-time", "0.1")
    assert mog(*command).stderr == ""
    told = mog(*command, "--verbose").stderr
    assert told.startswith("mog: ran Connectivity control of five vehicles from 0 to 0.1 s")
    assert told.count("\n") == 1
    assert "is in the cache" in mog(*command, "-vv").stderr
    assert mog(*command, "-v", "-q").exit_code == 2
    assert logging.getLogger("mixed_order_game").level == logging.NOTSET
    game = Game("five_vehicles")
    for key in ("x0", "dynamics", "disturbance"):
        del game.player(1)[key]
    game.player(1)["plant"] = "external"
    built = ("build", game.write("external.toml"))
    assert "communication step" in mog(*built).stderr
    assert mog(*built, "--quiet").stderr == ""


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["run", "five"], ["five_vehicles"]),
        (["run", "mine"], ["mine.toml"]),
        (["plot", "mi"], ["mine.csv", "mine.toml", "mixed/"]),
        (["build", "mi"], ["mine.toml", "mixed/"]),
        (["sweep", "--graphs", "small"], ["small-world:K:P"]),
        (["run", "--set", "W_m"], ["W_max="]),
        (["run", "cournot_isoelastic", "--set", "elast"], ["elasticity="]),
        (["run", "--variables", "x,nash"], ["x,nash_error"]),
        (["run", "--variables", "x[1,1],nash"], ["x[1,1],nash_error"]),
        (["run", "--variables", "nash_error,x[5,"], ["nash_error,x[5,1]", "nash_error,x[5,2]"]),
    ],
)  # fmt: skip
def test_the_shell_completes(words: list[str], expected: list[str]) -> None:
    for name in ("mine.toml", "mine.csv", "mine.txt"):
        Path(name).touch()
    Path("mixed").mkdir()
    environment = {"_MOG_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(["mog", *words])}
    environment["COMP_CWORD"] = str(len(words))
    done = CliRunner(env=environment).invoke(app, prog_name="mog")
    assert done.stdout.split() == expected, done.output


def test_completion_of_a_broken_installation_is_empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mixed_order_game.fmu.build._package_folders", lambda: iter(()))
    assert completion.complete_game("five") == []
