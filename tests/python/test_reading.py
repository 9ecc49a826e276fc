"""Files from other systems: byte order marks, other encodings and separators, suffixes in capitals."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mixed_order_game import (
    GameError,
    MixedOrderGameError,
    ModelError,
    ResultError,
    Simulator,
    build_fmu,
    default_game,
    load,
    read_model,
)
from mixed_order_game.fmu.schedule import read_disturbance, read_graph_schedule
from mixed_order_game.game.check import check_game
from mixed_order_game.theory.game import read_game

MARK = b"\xef\xbb\xbf"
INPUT = 'time,"d_ext[1,1]"\n0,1.5\n'
RESULT = 'time,"x[1,1]","x_star[1,1]"\n0,1.5,-0.5\n'
GRAPHS = '[[graph]]\ntime = 0\ngraph = "ring"\n'


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_a_byte_order_mark_means_nothing(fmu: Path, tmp_path: Path) -> None:
    game = written(tmp_path / "game.toml", MARK + default_game().read_bytes())
    assert check_game(game) == ()
    assert read_game(game).title == read_game(default_game()).title
    model = read_model(build_fmu(game, tmp_path / "game.fmu"))
    assert model.is_paper_example
    with Simulator(model.path) as simulator, Simulator(fmu) as plain:
        np.testing.assert_array_equal(simulator.run(stop_time=0.1).x, plain.run(stop_time=0.1).x)
    bad = written(game, MARK + default_game().read_bytes().replace(b"k1 = 10.0", b"k1 = 0.0"))
    (problem,) = check_game(bad)
    assert "k1 = 0.0" in bad.read_text().splitlines()[problem.line - 1]

    inputs = written(tmp_path / "input.csv", MARK + INPUT.encode())
    assert read_disturbance(inputs, model)(0.0)[0, 0] == 1.5
    graphs = written(tmp_path / "graphs.toml", MARK + GRAPHS.encode())
    assert read_graph_schedule(graphs, model).start_values()["a[1,2]"] == 1.0
    assert load(written(tmp_path / "result.csv", MARK + RESULT.encode())).x[0, 0, 0] == 1.5


def test_suffixes_in_capitals(fmu: Path, tmp_path: Path) -> None:
    model = read_model(written(tmp_path / "GAME.FMU", fmu.read_bytes()))
    game = written(tmp_path / "GAME.TOML", default_game().read_bytes())
    assert read_game(game).parameters.k1 == read_game(model.path).parameters.k1 == 10.0
    assert read_disturbance(written(tmp_path / "INPUT.CSV", INPUT.encode()), model)(0.0)[0, 0] == 1.5
    assert read_graph_schedule(written(tmp_path / "GRAPHS.TOML", GRAPHS.encode()), model).period is None
    result = load(written(tmp_path / "RESULT.CSV", RESULT.encode()))
    for name in ("AGAIN.CSV", "AGAIN.PARQUET"):
        np.testing.assert_array_equal(load(result.save(tmp_path / name)).x, result.x)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"time;x[1,1];x[1,2]\n0;1,5;2\n", "the separator is ';', expected commas (and points in numbers)"),
        (b'"time";"x[1,1]"\n0;1\n', "the separator is ';', expected commas"),
        (MARK + b"sep=;\ntime;x\n", "the separator is ';', expected commas"),
        (b"time\tx\n0\t1\n", r"the separator is '\t', expected commas"),
        (RESULT.encode("utf-16"), "it is UTF-16 text, expected UTF-8"),
        (b"time,x\n0,1\n1,caf\xe9\n", "line 3 holds the byte 0xE9, expected UTF-8 text"),
        (MARK + b"time,x\n\xe9,1\n", "line 2 holds the byte 0xE9, expected UTF-8 text"),
        (b"time,x[1,1]\n0,1\n", "the name x[1 is cut at its comma"),
        (b"time,x\n0,\n", "row 2: '' is not a number"),
        (b"time,x\n0,1\n2\n", "row 3 has 1 cell, the header has 2"),
        (b"time,x\n0," + b"1" * 200_000, "it is not CSV: field larger than field limit"),
        (b"", "the first line must name time"),
    ],
)
def test_tables_that_are_no_tables(content: bytes, told: str, fmu: Path, tmp_path: Path) -> None:
    table = written(tmp_path / "table.csv", content)
    with pytest.raises(ResultError) as error:
        load(table)
    assert str(error.value).startswith(f"{table} is not a result of this package: {told}")
    if "''" not in told:
        with pytest.raises(MixedOrderGameError, match=r"table\.csv") as refused:
            read_disturbance(table, read_model(fmu))
        assert told in str(refused.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ('title = "x"\n'.encode("utf-16"), "it is UTF-16 text, expected UTF-8"),
        (b'\n\ntitle = "caf\xe9"\n', "line 3 holds the byte 0xE9, expected UTF-8 text"),
        (b"title = \n", "it is not TOML: "),
        (b"a = " + b"9" * 5000, "it is not TOML: "),
        (b"a = " + b"[" * 100_000, "it is nested too deeply"),
    ],
)
def test_games_and_schedules_that_are_no_toml(content: bytes, told: str, fmu: Path, tmp_path: Path) -> None:
    file = written(tmp_path / "file.toml", content)
    with pytest.raises(MixedOrderGameError) as error:
        read_graph_schedule(file, read_model(fmu))
    assert str(error.value).startswith(f"{file} cannot be read: {told}")
    readers: list[Callable[[], object]] = [
        lambda: read_game(file),
        lambda: build_fmu(file, tmp_path / "out.fmu"),
    ]
    for read in readers:
        with pytest.raises(GameError, match="^" + str(file)):
            read()
    assert len(check_game(file)) >= 1


def test_what_is_no_file_is_told_in_words(tmp_path: Path) -> None:
    """Neither numbers of the system's errors nor a path twice."""
    for read, what, kind in (
        (build_fmu, "game file", GameError),
        (read_model, "FMU", ModelError),
        (load, "result file", ResultError),
    ):
        suffix = {"game file": ".toml", "FMU": ".fmu", "result file": ".csv"}[what]
        arguments = (tmp_path / "out.fmu",) if what == "game file" else ()
        folder, pipe, long = (tmp_path / f"{name}{suffix}" for name in ("folder", "pipe", "n" * 300))
        folder.mkdir()
        os.mkfifo(pipe)
        for path, told in (
            (tmp_path / f"none{suffix}", f"there is no {what} {tmp_path / 'none'}{suffix}"),
            (tmp_path / f"nul\0{suffix}", f"there is no {what} "),
            (folder, f"{folder} is a folder, expected a"),
            (pipe, f"{pipe} is not a regular file, expected a"),
            (long, f"{long} cannot be read: file name too long"),
        ):
            with pytest.raises(kind) as error:
                read(path, *arguments)
            assert str(error.value).startswith(told)
            assert "rrno" not in str(error.value)
