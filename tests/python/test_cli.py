"""The command: exit codes, sentences on stderr, files and JSON."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from mixed_order_game import default_game, load, package_version
from mixed_order_game.cli.app import app
from mixed_order_game.extras import EXTRAS
from mixed_order_game.results.metrics import JUDGED

COMMANDS = ["build", "info", "run", "validate", "plot", "demo"]


def mog(*arguments: object) -> Result:
    return CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1"}).invoke(app, [str(each) for each in arguments])


def sentence(result: Result) -> str:
    """The one sentence on stderr of a command that ended with 1."""
    assert result.exit_code == 1, result.output
    assert result.stderr.startswith("mog: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def test_version_and_help() -> None:
    assert mog("--version").stdout == f"mog {package_version()}\n"
    assert mog().exit_code == 2
    top = mog("--help")
    assert top.exit_code == 0
    for command in COMMANDS:
        assert command in top.stdout
        told = mog(command, "--help")
        assert told.exit_code == 0
        assert f"mog {command}" in told.stdout.split("Example")[1]


def test_installed_command(fmu: Path) -> None:
    command = [sys.executable, "-m", "mixed_order_game", "run", str(fmu), "--stop-time", "0.1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "6 samples" in done.stdout
    bad = subprocess.run([*command, "--set", "k1=-1"], capture_output=True, text=True, check=False)
    assert bad.returncode == 1
    assert bad.stderr.startswith("mog: k1 is -1, expected")
    assert bad.stderr.count("\n") == 1
    wrong = subprocess.run([*command, "--nonsense"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["run", "--nonsense"],
        ["run", "--set", "k1"],
        ["run", "--variables", ","],
        ["run", "--set", "=1"],
        ["run", "--set", "k1=ten"],
        ["run", "--set", "k1=1", "--set", "k1=2"],
        ["run", "--stop-time", "soon"],
        ["run", "--output", "result.xlsx"],
        ["validate", "--neighbourhood", "-1"],
        ["validate", "--limit", "0"],
        ["plot", "--format", "bmp"],
        ["plot", "--width", "wide"],
        ["build", "one.toml", "two.toml"],
    ],
)
def test_wrong_usage_exits_with_2(arguments: list[str]) -> None:
    result = mog(*arguments)
    assert result.exit_code == 2
    assert "Usage" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--set", "k5=1"], "there is no variable k5"),
        (["--set", "x[1,1]=1"], "x[1,1] cannot be set: it is a continuous output"),
        (["--set", "k1=nan"], "k1 must be finite"),
        (["--set", "k1=true"], "k1 is a number"),
        (["--set", "robust=1"], "robust is true or false"),
        (["--set", "a[1,2]=-1"], "expected a number of at least 0"),
        (["--set", "a[1,2]=0", "--set", "a[2,3]=0"], "connected"),
        (["--stop-time", "0"], "stop_time"),
        (["--step", "-1"], "step"),
        (["--tolerance", "2"], "tolerance"),
        (["--variables", "x,nothing"], "there is no variable nothing"),
    ],
)
def test_errors_of_run(arguments: list[str], told: str, fmu: Path) -> None:
    assert told in sentence(mog("run", fmu, *arguments))


def test_kinds_and_words_in_settings(fmu: Path, tmp_path: Path) -> None:
    """A name without indices stands for all of its kind, a switch takes words, as in sweeps."""
    output = tmp_path / "run.parquet"
    options = ["--set", "a=0.5", "--set", "Perturbed=no".lower(), "--set", "robust=OFF", "--stop-time", 0.1]
    assert mog("run", fmu, *options, "--output", output).exit_code == 0
    parameters = load(output).parameters
    assert {value for name, value in parameters.items() if name.startswith("a[")} == {0.5}
    assert (parameters["perturbed"], parameters["robust"]) == (False, False)
    told = sentence(mog("run", fmu, "--set", "a=1", "--set", "a[1,2]=2"))
    assert told == "mog: a[1,2] is set by both a and a[1,2]\n"
    assert "k5; did you mean k4 or k3 or k2?" in sentence(mog("run", fmu, "--set", "k5=1"))
    compared = mog("compare", fmu, "--set", "x0=1", "--variant", "still: perturbed=no, a=2", "--json",
                   "--no-baselines", "--stop-time", 0.1)  # fmt: skip
    changed = json.loads(compared.stdout)["still"]["changed"]
    assert (changed["perturbed"], changed["a[1,3]"], changed["x0[5,2]"]) == (False, 2.0, 1.0)


@pytest.mark.parametrize("command", ["info", "run", "validate", "plot"])
def test_files_that_are_no_games(command: str, tmp_path: Path) -> None:
    (tmp_path / "text.fmu").write_text("text")
    (tmp_path / "bad.toml").write_text("title = 1")
    told = sentence(mog(command, tmp_path / "game.txt"))
    assert f"mog: {tmp_path / 'game.txt'} ends in .txt, expected an FMU (.fmu)" in told
    assert ("result (.parquet, .csv)" in told) == (command == "plot")
    assert "there is no game nothing; those" in sentence(mog(command, "nothing"))
    assert "there is no FMU" in sentence(mog(command, tmp_path / "none.fmu"))
    assert "cannot be read" in sentence(mog(command, tmp_path / "text.fmu"))
    assert "there is no game file" in sentence(mog(command, tmp_path / "none.toml"))
    sentence(mog(command, tmp_path / "bad.toml"))


@pytest.mark.parametrize("command", ["run", "build", "check", "analyse", "plot", "compare", "report"])
def test_what_was_meant_by_a_name(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file without a suffix, one that is missing and a game of the package."""
    monkeypatch.chdir(tmp_path)
    Path("mine").write_text("text")
    Path("mine.toml").write_text("text")
    told = sentence(mog(command, "mine"))
    assert told.startswith("mog: mine is a file without a suffix, expected ")
    assert told.endswith("or the name of a game of the package; did you mean mine.toml?\n")
    fmu, result = command not in ("build", "check"), command in ("plot", "compare", "report")
    assert ("an FMU (.fmu)" in told, "a result (.parquet, .csv)" in told) == (fmu, result)
    assert sentence(mog(command, "five_vehicle")).startswith(
        "mog: there is no game five_vehicle; did you mean five_vehicles"
    )
    assert (
        sentence(mog(command, "min.toml")) == "mog: there is no game file min.toml; did you mean mine.toml?\n"
    )
    if result:
        Path("run.csv").write_text("text")
        assert sentence(mog(command, "run")) == "mog: there is no game run; did you mean run.csv?\n"
        assert sentence(mog(command, "runs.csv")).endswith("result file runs.csv; did you mean run.csv?\n")


def test_build(fmu: Path, tmp_path: Path) -> None:
    output = tmp_path / "built.fmu"
    result = mog("build", default_game(), "--output", output)
    assert (result.exit_code, result.stdout) == (0, f"{output}\n")
    assert output.read_bytes() == fmu.read_bytes()
    bad = tmp_path / "bad.toml"
    bad.write_text(default_game().read_text().replace("k1 = 10.0", "k1 = 0.0"))
    assert "k1" in sentence(mog("build", bad, "--output", tmp_path / "bad.fmu"))
    assert not (tmp_path / "bad.fmu").exists()
    for command, options in (("build", ["--output", tmp_path / "bad.fmu"]), ("check", [])):
        told = sentence(mog(command, fmu, *options))
        assert (
            told
            == f"mog: {fmu} is an FMU, expected a game file (.toml) or the name of a game of the package\n"
        )


def test_info(fmu: Path) -> None:
    text = mog("info", fmu).stdout
    for part in (
        "1,1,1,2,2",
        "1-2, 1-5, 2-3, 3-4, 4-5",
        "k1 = 10",
        "ours",
        "the paper's",
        "canGetAndSetFMUstate",
    ):
        assert part in text
    assert "x_star[1,1]" in mog("info", fmu, "--variables").stdout
    data = json.loads(mog("info", fmu, "--json", "--variables").stdout)
    assert (data["players"], data["dimension"], data["neurons"]) == (5, 2, 11)
    assert data["paper_example"] is True
    assert {entry["name"] for entry in data["variables"]} >= {"k1", "x[1,1]"}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_run_writes_files(suffix: str, fmu: Path, tmp_path: Path) -> None:
    output = tmp_path / f"run{suffix}"
    options = ["--set", "a[1,3]=0.5", "--set", "perturbed=false", "--stop-time", 1, "--step", 0.1]
    result = mog("run", fmu, *options, "--variables", "x[1,2],v", "--variables", "nash_error", "-o", output)
    assert (result.exit_code, result.stdout) == (0, f"{output}\n")
    loaded = load(output)
    assert loaded.time.shape == (11,)
    assert [name for name in loaded.columns if not name.startswith("x_star")] == [
        "x[1,2]",
        *(f"v[{i},{k}]" for i in (4, 5) for k in (1, 2)),
        "nash_error",
        *JUDGED,
    ]
    if suffix == ".parquet":
        assert loaded.parameters["a[1,3]"] == 0.5
        assert loaded.stop_time == 1.0


def test_run_takes_a_game_or_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for arguments in ([], [default_game()], ["five_vehicles"]):
        result = mog("run", *arguments, "--stop-time", 0.1)
        assert result.exit_code == 0
        assert "Connectivity control of five vehicles" in result.stdout


def test_validate(fmu: Path) -> None:
    result = mog("validate", fmu, "--strict")
    assert result.exit_code == 0, result.output
    assert result.stdout.count("holds") == 9
    assert "Every claim holds." in result.stdout
    short = mog("validate", fmu, "--limit", 20, "--json")
    assert short.exit_code == 0
    data = json.loads(short.stdout)
    assert (data["passed"], data["holds"]) == (True, False)
    strict = mog("validate", fmu, "--limit", 20, "--strict")
    assert strict.exit_code == 1
    signals = ("actions", "velocities", "estimates")
    assert (
        strict.stderr
        == f"mog: {', '.join(f'practical_convergence_{each}' for each in signals)}: not settled\n"
    )
    failed = mog("validate", fmu, "--neighbourhood", 1e-5)
    assert failed.exit_code == 1
    assert failed.stderr == "mog: neighbourhood: fails\n"


def test_plot_of_game_and_results(fmu: Path, tmp_path: Path) -> None:
    result = mog("plot", fmu, "--output", tmp_path / "game", "--format", "svg")
    assert result.exit_code == 0, result.output
    assert {path.name for path in (tmp_path / "game").iterdir()} == {
        "positions_robust.svg",
        "velocities_robust.svg",
        "positions_unperturbed.svg",
        "velocities_unperturbed.svg",
        "error.svg",
        "plane.svg",
        "graph.svg",
        "control.svg",
        "weights.svg",
        "estimates.svg",
    }
    for suffix, kinds in (("csv", 7), ("parquet", 8)):  # a CSV file does not hold the graph
        run = tmp_path / f"run.{suffix}"
        assert mog("run", fmu, "--stop-time", 2, "--output", run).exit_code == 0
        drawn = mog("plot", run, "--output", tmp_path / suffix, "--format", "png", "--width", "page")
        assert drawn.exit_code == 0, drawn.output
        assert len(list((tmp_path / suffix).iterdir())) == kinds
    options = ("--output", tmp_path / "few", "--kind", "error", "--kind", "control", "--until", 0.5)
    few = mog("plot", fmu, *options)
    assert [Path(line).name for line in few.stdout.splitlines()] == ["error.pdf", "control.pdf"]
    assert mog("plot", fmu, "--kind", "pie").exit_code == 2
    no_plane = mog("plot", "energy_consumption", "--kind", "plane")
    assert "the game has 1 coordinate, not 2" in sentence(no_plane)
    assert "nothing to draw until -1 s" in sentence(mog("plot", run, "--until", -1))
    sentence(mog("plot", tmp_path / "none.csv"))


def test_demo(fmu: Path, tmp_path: Path) -> None:
    result = mog("demo", "--fmu", fmu, "--output", tmp_path / "demo")
    assert result.exit_code == 0, result.output
    names = {path.name for path in (tmp_path / "demo").iterdir()}
    assert {"claims.json", "robust.parquet", "unperturbed.parquet", "positions_robust.png"} <= names
    assert result.stdout.count("holds") == 9
    assert json.loads((tmp_path / "demo" / "claims.json").read_text())["passed"] is True
    (tmp_path / "file").write_text("")
    sentence(mog("demo", "--fmu", fmu, "--output", tmp_path / "file"))


def test_demo_needs_no_extra(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in EXTRAS:
        monkeypatch.setitem(sys.modules, package, None)
    done = mog("demo", "--fmu", fmu, "--output", tmp_path / "demo")
    assert done.exit_code == 0
    assert done.stderr.endswith('no figures without matplotlib: pip install "mixed-order-game[plot]"\n')
    names = {path.name for path in (tmp_path / "demo").iterdir()}
    assert names == {"claims.json", "robust.csv", "unperturbed.csv"}


@pytest.mark.parametrize(
    ("console", "title", "byte"),
    [
        ({"PYTHONIOENCODING": "cp1252"}, b"\\u4e94 Fahrz\xfcge", b"\\udcff"),
        ({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, b"\\u4e94 Fahrz\\xfcge", b"\\udcff"),
        ({"PYTHONIOENCODING": "utf-8"}, "五 Fahrzüge".encode(), b"\xff"),
    ],
)
def test_any_title_and_path_on_any_console(
    console: dict[str, str], title: bytes, byte: bytes, tmp_path: Path
) -> None:
    """Characters that the console lacks are shown as codes; bytes of a file's name that are no text stay."""
    cache = os.fsencode(tmp_path) + b"/\xff"
    game = tmp_path / "game.toml"
    text = default_game().read_text(encoding="utf-8")
    game.write_text(text.replace("Connectivity control of five vehicles", "五 Fahrzüge"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "mixed_order_game", "info", str(game)],
        capture_output=True,
        env={**os.environ, "XDG_CACHE_HOME": os.fsdecode(cache), "COLUMNS": "300", **console},
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert title in done.stdout
    assert b"/" + byte + b"/mixed-order-game/" in done.stdout


def test_output_that_takes_no_more(fmu: Path) -> None:
    command = [sys.executable, "-m", "mixed_order_game", "info", str(fmu)]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, check=False)
    assert (done.returncode, done.stderr) == (1, b"mog: no space left on device\n")


def test_results_are_the_same_in_any_locale_and_folder(fmu: Path, tmp_path: Path) -> None:
    outputs = []
    for name, language in (("a", "C"), ("b", "de_DE.UTF-8")):
        folder = tmp_path / name
        folder.mkdir()
        command = [
            sys.executable,
            "-m",
            "mixed_order_game",
            "run",
            str(fmu),
            "--stop-time",
            "1",
            "-o",
            "r.csv",
        ]
        subprocess.run(command, cwd=folder, env={**os.environ, "LC_ALL": language}, check=True)
        outputs.append((folder / "r.csv").read_bytes())
    assert outputs[0] == outputs[1]
