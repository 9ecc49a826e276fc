"""The rule for files that are written: whole, never over an input, over nothing of another kind unasked."""

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mixed_order_game import BuildError, Result, ResultError, Simulator, build_fmu, default_game, load, run
from mixed_order_game.cli import app as cli
from mixed_order_game.files.writing import FIGURE, RESULT, check_output, write_whole
from mixed_order_game.fmu.model import read_model
from mixed_order_game.fmu.schedule import GraphSchedule, write_disturbance, write_graph_schedule
from mixed_order_game.results import plot


def result() -> Result:
    ones = np.ones(3)
    return Result(time=np.arange(3.0), columns={"x[1,1]": ones, "x_star[1,1]": ones, "nash_error": ones})


def figure(path: Path, *, force: bool = False) -> Path:
    return plot.save_figure(plot.new_axes(), path, force=force)


def disturbance(path: Path, *, force: bool = False) -> Path:
    return write_disturbance(path, [0.0], np.zeros((1, 2, 1)), force=force)


def schedule(path: Path, *, force: bool = False) -> Path:
    return write_graph_schedule(path, GraphSchedule(((0.0, {"a[1,2]": 1.0}),)), force=force)


def save(path: Path, *, force: bool = False) -> Path:
    return result().save(path, force=force)


WRITERS = {
    "run.csv": save,
    "run.parquet": save,
    "a.pdf": figure,
    "a.svg": figure,
    "a.png": figure,
    "gust.csv": disturbance,
    "edges.csv": schedule,
}


@pytest.fixture
def umask() -> Iterator[int]:
    before = os.umask(0o027)
    yield 0o027
    os.umask(before)


@pytest.mark.parametrize("name", WRITERS)
def test_its_own_kind_is_replaced_and_no_other(name: str, tmp_path: Path) -> None:
    path, write = tmp_path / name, WRITERS[name]
    write(path)
    content = path.read_bytes()
    path.chmod(0o640)
    assert write(path).read_bytes() == content
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    for foreign in (b"time,mine\n0,1\n", b"%PDF-1.7 my thesis", b"PAR1"):
        path.write_bytes(foreign)
        with pytest.raises(ResultError, match=f"{name} exists and is not .*--force"):
            write(path)
        assert path.read_bytes() == foreign
    write(path, force=True)
    assert path.read_bytes() == content
    path.write_bytes(b"")  # nothing to lose
    write(path)
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_an_input_is_not_a_result(tmp_path: Path) -> None:
    for write in (disturbance, schedule):
        path = write(tmp_path / f"{write.__name__}.csv")
        with pytest.raises(ResultError, match="is not a result"):
            save(path)
    with pytest.raises(ResultError, match="is not a table of d_ext"):
        disturbance(save(tmp_path / "run.csv"))


def test_umask(umask: int, tmp_path: Path, fmu: Path) -> None:
    for path in (save(tmp_path / "run.csv"), build_fmu(default_game(), tmp_path / "folder" / "a.fmu")):
        assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~umask
    assert (tmp_path / "folder" / "a.fmu").read_bytes() == fmu.read_bytes()


def test_symbolic_links_stay(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link, target = tmp_path / "run.csv", tmp_path / "elsewhere" / "data.csv"
    link.symlink_to(target)
    for _ in range(2):  # to a file that does not exist yet, and to one that does
        save(link)
        assert link.is_symlink()
        assert load(target).time.tolist() == [0.0, 1.0, 2.0]
    circle = tmp_path / "circle.csv"
    circle.symlink_to(circle)
    with pytest.raises(ResultError, match="cannot write"):
        save(circle)


def test_a_folder_that_lets_nothing_be_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    for name in ("open", "unlink"):
        monkeypatch.setattr(Path, name, refuse)
    with pytest.raises(ResultError, match=r"cannot write .*run\.csv: permission denied"):
        save(tmp_path / "run.csv")


def test_places_that_take_no_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    for path, told in {
        "file/run.csv": "it is not a folder",
        "file/deeper/run.csv": "it is not a folder",
        "folder.csv": "it is a folder",
        "pipe.csv": "not a regular file",
        "run.txt": r"must end in \.csv or \.parquet",
    }.items():
        with pytest.raises(ResultError, match=told):
            save(tmp_path / path, force=True)
    assert check_output(tmp_path / "not" / "yet" / "RUN.CSV", RESULT) == tmp_path / "not" / "yet" / "RUN.CSV"
    assert not (tmp_path / "not").exists()


def test_interrupted_writing_leaves_nothing(tmp_path: Path) -> None:
    save(tmp_path / "run.csv")
    before = (tmp_path / "run.csv").read_bytes()

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "run.csv", stop)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]
    assert (tmp_path / "run.csv").read_bytes() == before


@pytest.mark.parametrize("how", ["hard link", "symbolic link"])
def test_never_over_an_input(how: str, tmp_path: Path) -> None:
    game = tmp_path / "game.toml"
    game.write_bytes(default_game().read_bytes())
    output = tmp_path / "game.fmu"
    if how == "hard link":
        output.hardlink_to(game)
    else:
        output.symlink_to(game)
    with pytest.raises(BuildError, match="is what is read here"):
        build_fmu(game, output, force=True)
    assert game.read_bytes() == default_game().read_bytes()


def mog(*arguments: object) -> tuple[int, str]:
    done = CliRunner(env={"COLUMNS": "200"}).invoke(cli.app, [str(each) for each in arguments])
    return done.exit_code, done.output


@pytest.mark.parametrize(
    "arguments",
    [
        ["build", "{game}", "--output", "{game}"],
        ["build", "--output", "game"],
        ["run", "{fmu}", "--output", "run.txt"],
        ["report", "{fmu}", "--output", "page.htm"],
        ["new", "game.tml"],
        ["schema", "--output", "schema"],
        ["compare", "{fmu}", "--figure", "a.bmp"],
    ],
)
def test_suffixes_that_no_command_reads(
    arguments: list[str], fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    game = tmp_path / "game.toml"
    game.write_bytes(default_game().read_bytes())
    code, told = mog(*(each.format(game=game, fmu=fmu) for each in arguments))
    assert code == 2
    assert "must end in" in told
    assert [path.name for path in tmp_path.iterdir()] == ["game.toml"]
    assert game.read_bytes() == default_game().read_bytes()


COMMANDS: dict[str, list[object]] = {
    "a.fmu": ["build", "--output", "{folder}/a.fmu"],
    "run.csv": ["run", "{fmu}", "--stop-time", 0.1, "--output", "{folder}/run.csv"],
    "report.html": ["report", "{run}", "--output", "{folder}/report.html"],
    "error.svg": ["plot", "{run}", "--output", "{folder}", "--format", "svg"],
    "errors.svg": ["compare", "{run}", "--figure", "{folder}/errors.svg"],
    "game.toml": ["new", "{folder}/game.toml"],
    "schema.json": ["schema", "--output", "{folder}/schema.json"],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_asks_for_force(name: str, fmu: Path, tmp_path: Path) -> None:
    """The second time over what it wrote, which only `new` never replaces; never over what is not its own."""
    recorded = run(fmu, stop_time=0.1).save(tmp_path / "recorded.parquet")
    folder = tmp_path / "folder"
    arguments = [str(each).format(folder=folder, fmu=fmu, run=recorded) for each in COMMANDS[name]]
    for expected in (0, int(name == "game.toml")):
        code, told = mog(*arguments)
        assert code == expected, told
    (folder / name).write_text("mine")
    code, told = mog(*arguments)
    assert code == 1
    assert f"{name} exists" in told
    assert "--force" in told
    assert (folder / name).read_text() == "mine"
    code, told = mog(*arguments, "--force")
    assert code == 0, told
    assert (folder / name).stat().st_size > 1000


def test_refused_before_any_run(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """demo, run, report and plot know before they simulate that a file of the user stands in their way."""
    monkeypatch.setattr(Simulator, "run", lambda *_, **__: pytest.fail("it was run"))
    for name in ("plane.pdf", "claims.json", "run.csv", "page.html"):
        (tmp_path / name).write_text("mine")
    for arguments in (
        ["demo", "--fmu", fmu, "--output", tmp_path],
        ["plot", fmu, "--output", tmp_path],
        ["run", fmu, "--output", tmp_path / "run.csv"],
        ["report", fmu, "--output", tmp_path / "page.html"],
        ["run", fmu, "--output", tmp_path / "run.csv" / "deeper.csv"],
    ):
        code, told = mog(*arguments)
        assert code == 1
        assert "exists" in told or "cannot write" in told


def test_names_of_figures_are_known_before_the_run(fmu: Path) -> None:
    robust, plain = (run(fmu, stop_time=0.1, start_values={"robust": on}) for on in (True, False))
    assert plot.paper_figure_names(read_model(fmu)) == list(plot.paper_figures(robust, plain))
    assert FIGURE.ending == ".pdf, .svg or .png"
