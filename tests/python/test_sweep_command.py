"""The commands sweep, tune and compare: what they print, write and answer with."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from mixed_order_game import run
from mixed_order_game.cli.app import app
from mixed_order_game.cli.progress import counted_progress
from mixed_order_game.studies.sampler import Sampler
from mixed_order_game.studies.sweep.table import load_sweep


def mog(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.mark.parametrize("command", ["sweep", "tune", "compare"])
def test_help_has_an_example(command: str) -> None:
    result = mog(command, "--help")
    assert result.exit_code == 0
    assert f"mog {command}" in result.output
    assert "Example" in result.output


def test_sweep(fmu: Path, tmp_path: Path) -> None:
    folder = tmp_path / "s"
    arguments = ["sweep", fmu, "--output", folder, "--grid", "k1=5:20:3", "--grid", "a[1,3]=0,0.5", "--set"]
    arguments += ["perturbed=false", "--stop-time", 0.5, "--jobs", 1, "--heat-map", "k1,a[1,3],control_peak"]
    result = mog(*arguments)
    assert result.exit_code == 0, result.output
    assert "6 runs in" in result.output
    assert "median settling time" in result.output
    assert (folder / "heat_map_k1_a-1-3-_control-peak.pdf").is_file()
    swept = load_sweep(folder)
    assert len(swept) == 6
    assert set(swept["a[1,3]"]) == {0.0, 0.5}

    again = mog(*arguments, "--json")
    assert again.exit_code == 0
    data = json.loads(again.stdout)
    assert data["rows"] == 6
    assert data["provenance"]["changed"] == {"perturbed": False}
    other = mog("sweep", fmu, "--output", folder, "--grid", "k1=1,2", "--stop-time", 0.5)
    assert other.exit_code == 1
    assert other.stderr.startswith("mog: ")
    assert "holds another sweep" in other.stderr


def test_sweep_of_samples_graphs_and_states(fmu: Path, tmp_path: Path) -> None:
    arguments = ["sweep", fmu, "--output", tmp_path / "s", "--range", "k2=0.5:2", "--range", "k3=10:100:log"]
    arguments += [
        "--samples",
        2,
        "--design",
        "sobol",
        "--graphs",
        "random:0.6@2",
        "--graphs",
        "own",
        "--seed",
        7,
    ]
    arguments += ["--initial-states", 2, "--initial-actions=-1:1", "--initial-velocities=0:1"]
    result = mog(*arguments, "--stop-time", 0.1, "--jobs", 1, "--settle-time", 0.05, "--band", 0.5)
    assert result.exit_code == 0, result.output
    swept = load_sweep(tmp_path / "s")
    assert len(swept) == 3 * 2 * 2
    assert abs(swept["x0[1,1]"]).max() <= 1.0
    assert swept["v0[4,1]"].min() >= 0.0


def test_sweep_that_misses(fmu: Path, tmp_path: Path) -> None:
    arguments = ["sweep", fmu, "--output", tmp_path / "s", "--grid", "delta=0,10", "--neighbourhood", 0.01]
    result = mog(*arguments, "--jobs", 1)
    assert result.exit_code == 1
    assert "all but 1 runs stay below" in result.stdout
    assert result.stderr.strip().endswith("mog: 1 row (0) of 2 missed the neighbourhood 0.01")
    nothing = mog("sweep", fmu, "--output", tmp_path / "t", "--set", "a=0", "--jobs", 1)
    assert nothing.exit_code == 1
    assert "no run succeeded" in nothing.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--grid", "k1"], "NAME=... expected"),
        (["--grid", "k1=x"], "a number, true or false"),
        (["--grid", "k1=1", "--grid", "k1=2"], "k1 is given twice"),
        (["--range", "k1=5"], "not a range"),
        (["--set", "k1=high"], "a number, true or false"),
        (["--graphs", "circle"], "no kind of graph"),
        (["--initial-actions", "5"], "not a range"),
        (["--heat-map", "k1,k2"], "X,Y,FIGURE expected"),
        (["--example", "--grid", "k1=1,2"], "the example has its own"),
        (["--jobs", "0"], "greater than or equal to 1"),
        (["--nonsense"], "No such option"),
    ],
)
def test_wrong_usage_of_sweep(arguments: list[str], told: str, fmu: Path, tmp_path: Path) -> None:
    result = mog("sweep", fmu, "--output", tmp_path / "s", *arguments)
    assert result.exit_code == 2
    assert told in " ".join(result.stderr.replace("│", " ").split())


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["none.fmu"], "there is no FMU none.fmu"),
        (["none.txt"], "expected an FMU"),
        (["--grid", "k9=1,2"], "there is no variable k9"),
        (["--range", "k1=1:2", "--samples", "3", "--design", "sobol"], "power of two"),
    ],
)
def test_errors_of_sweep_are_one_sentence(arguments: list[str], told: str, fmu: Path, tmp_path: Path) -> None:
    first = [] if arguments[0].startswith("none") else [fmu]
    result = mog("sweep", *first, *arguments, "--output", tmp_path / "s")
    assert result.exit_code == 1
    assert result.stderr.startswith("mog: ")
    assert told in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_heat_map_is_judged_before_any_run(fmu: Path, tmp_path: Path) -> None:
    folder = tmp_path / "s"
    arguments = ["sweep", fmu, "--output", folder, "--grid", "k1=1,2", "--grid", "k2=1,2", "--heat-map"]
    wrong = mog(*arguments, "k1,k2,settling")
    assert wrong.exit_code == 1
    assert "the sweep has no column settling" in wrong.stderr
    assert not folder.exists()
    folder.mkdir()
    (folder / "heat_map_k1_k2_events.pdf").write_text("mine")
    assert "exists and is not a figure" in mog(*arguments, "k1,k2,events").stderr


def test_compare_judges_all_games_before_any_run(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Sampler, "record", lambda *_: pytest.fail("it was run"))
    for arguments, told in (
        ([fmu, tmp_path / "none.fmu"], "there is no FMU"),
        ([fmu, "--variant", "a: k1=20", "--variant", "b: k9=1"], "there is no variable k9"),
        ([fmu, "--figure", tmp_path / "mine.pdf"], "is not a figure"),
    ):
        (tmp_path / "mine.pdf").write_text("mine")
        result = mog("compare", *arguments)
        assert result.exit_code == 1
        assert told in result.stderr


def test_tune(fmu: Path) -> None:
    arguments = ["tune", fmu, "--settling-time", 2, "--gains", "k1,k2", "--range", "k1=2:50:log"]
    result = mog(*arguments)
    assert result.exit_code == 0, result.output
    assert "use: --set k1=" in result.stdout
    data = json.loads(mog(*arguments, "--json", "--graphs", "ring", "--graphs", "star", "--jobs", 1).stdout)
    assert data["met"]
    assert data["graphs"] == 2
    short = mog("tune", fmu, "--settling-time", 0.2, "--gains", "k1", "--range", "k1=1:2")
    assert short.exit_code == 1
    assert "no gains in the ranges" in short.stderr
    assert mog("tune", fmu).exit_code == 2
    assert mog("tune", fmu, "--settling-time", 1, "--range", "k1").exit_code == 2
    wrong = mog("tune", fmu, "--settling-time", 1, "--gains", "k1,rho")
    assert wrong.exit_code == 1
    assert "rho is not a gain" in wrong.stderr


def test_compare(fmu: Path, tmp_path: Path) -> None:
    figure = tmp_path / "errors.pdf"
    variant = "mine: k1=20, a[1,3]=0.5"
    result = mog("compare", fmu, "--variant", variant, "--stop-time", 1, "--figure", figure)
    assert result.exit_code == 0, result.output
    for label in ("as it is", "mine", "without network", "without phi", "without both"):
        assert label in result.stdout
    assert figure.is_file()
    file = run(fmu, stop_time=1.0).save(tmp_path / "mine.parquet")
    together = mog("compare", file, fmu, "--no-baselines", "--stop-time", 1, "--json")
    data = json.loads(together.stdout)
    assert list(data) == ["mine", "MixedOrderGame: as it is"]
    assert data["mine"]["metrics"]["band"] == data["MixedOrderGame: as it is"]["metrics"]["band"]
    assert mog("compare", file, "--variant", variant).exit_code == 2
    assert mog("compare", fmu, "--variant", "k1=20").exit_code == 2
    missing = mog("compare", tmp_path / "none.parquet")
    assert missing.exit_code == 1
    assert "there is no result file" in missing.stderr


def test_lines_of_progress(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    clock = iter([0.0, 1.0, 5.0, 12.0, 13.0, 23.0])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    with counted_progress("sweeping") as show:
        for done in (10, 20, 40, 42, 60):
            show(done, 100)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["sweeping: 40 of 100, 22 s left", "sweeping: 60 of 100, 18 s left"]
