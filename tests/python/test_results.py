"""Results: shapes, exact round trips through files, conversions, and what is told of a missing signal."""

import csv
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mixed_order_game import Result, ResultError, load
from mixed_order_game.names import parse_name, split_names
from mixed_order_game.results.result import gather

T, N, D = 7, 3, 2
ORDER = (1, 2, 1)


def make(**options: object) -> Result:
    rng = np.random.default_rng(3)
    columns: dict[str, Any] = {}
    for i in range(1, N + 1):
        for coordinate in range(1, D + 1):
            index = f"[{i},{coordinate}]"
            columns[f"x{index}"] = rng.normal(size=T)
            columns[("v" if ORDER[i - 1] == 2 else "z") + index] = rng.normal(size=T)
            columns[f"u{index}"] = rng.normal(size=T) / 3.0
            columns[f"x_star{index}"] = np.full(T, -0.5)
            for j in range(1, N + 1):
                columns[f"y[{i},{j},{coordinate}]"] = rng.normal(size=T)
    columns["nash_error"] = np.geomspace(1.0, 1e-300, T)
    columns["solver_steps"] = np.arange(T) * 1e9
    values: dict[str, object] = {
        "units": {"v[2,1]": "1/s", "u[1,1]": "1/s", "u[2,1]": "1/s2", "u[2,2]": "1/s2"},
        "parameters": {"k1": 0.1, "robust": True, "a[1,2]": 1.0},
        "title": "three players",
        "guid": "{1}",
        "package_version": "0.1.0",
        "stop_time": 3.0,
        "step": 0.5,
        "tolerance": 1e-6,
        "messages": ("one, two",),
    }
    return Result(time=np.linspace(0.0, 3.0, T), columns=columns, **(values | options))  # type: ignore[arg-type]


def test_shapes_and_indices() -> None:
    result = make()
    assert (result.players, result.dimension) == (N, D)
    assert result.x.shape == (T, N, D)
    np.testing.assert_array_equal(result.x[:, 2, 1], result["x[3,2]"])
    np.testing.assert_array_equal(result.v[:, 1, 0], result["v[2,1]"])
    assert np.isnan(result.v[:, [0, 2]]).all()
    assert np.isnan(result.z[:, 1]).all()
    assert result.y.shape == (T, N, N, D)
    np.testing.assert_array_equal(result.y[:, 0, 2, 1], result["y[1,3,2]"])
    assert result.x_star.shape == (N, D)
    assert result.largest_error(2.9, 3.0) == np.abs(result.x[-1] + 0.5).max()
    assert result.largest_velocity() == np.abs(result.v[:, 1]).max()


def test_all_first_order_have_no_velocity() -> None:
    result = make()
    columns = {name: column for name, column in result.columns.items() if not name.startswith("v")}
    alone = Result(time=result.time, columns=columns, parameters={"z0[1,1]": 0.0})
    assert np.isnan(alone.v).all()
    assert alone.largest_velocity() == 0.0
    # A file without parameters tells it by the references; where nothing does, velocities may be left out.
    references = {f"z[{i},{k}]": columns["x[1,1]"] for i in range(1, 4) for k in (1, 2)}
    assert np.isnan(Result(time=result.time, columns=columns | references).v).all()
    with pytest.raises(ResultError, match="v was not recorded"):
        _ = Result(time=result.time, columns=columns).v


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_round_trip_is_exact(suffix: str, tmp_path: Path) -> None:
    result = make()
    again = load(result.save(tmp_path / "folder" / f"run{suffix}"))
    np.testing.assert_array_equal(again.time, result.time)
    assert list(again.columns) == list(result.columns)
    for name, column in result.columns.items():
        np.testing.assert_array_equal(again[name], column)
    assert [path.name for path in (tmp_path / "folder").iterdir()] == [f"run{suffix}"]


@settings(deadline=None)  # of files on shared cores
@given(arrays(np.float64, st.integers(1, 20), elements=st.floats(width=64)))
def test_files_keep_every_digit(values: np.ndarray) -> None:
    result = Result(time=np.arange(float(len(values))), columns={"x[1,1]": values, 'odd "name",': -values})
    with TemporaryDirectory() as folder:
        for suffix in (".csv", ".parquet"):
            again = load(result.save(Path(folder) / f"run{suffix}"))
            for name, column in result.columns.items():
                np.testing.assert_array_equal(again[name], column)


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from("xvW"), st.lists(st.integers(1, 99), max_size=3))))
def test_split_and_parse_invert_joining(parts: list[tuple[str, list[int]]]) -> None:
    names = [stem + (f"[{','.join(map(str, index))}]" if index else "") for stem, index in parts]
    assert split_names(", ".join(names)) == names
    assert [parse_name(name) for name in names] == [(stem, tuple(index)) for stem, index in parts]


def test_parquet_keeps_what_belongs_to_the_run(tmp_path: Path) -> None:
    result = make()
    again = load(result.save(tmp_path / "run.parquet"))
    for name in ("parameters", "units", "title", "guid", "package_version", "stop_time", "tolerance", "step"):
        assert getattr(again, name) == getattr(result, name), name
    assert again.messages == result.messages


def test_csv_header_is_quoted(tmp_path: Path) -> None:
    path = make().save(tmp_path / "run.csv")
    assert path.read_text().startswith('"time","x[1,1]"')
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    assert {len(row) for row in rows} == {1 + len(make().columns)}
    assert "x[3,2]" in pd.read_csv(path).columns


def test_to_pandas() -> None:
    frame = make().to_pandas()
    assert frame.index.name == "time"
    assert frame.shape == (T, len(make().columns))
    np.testing.assert_array_equal(frame["x[3,2]"].to_numpy(), make()["x[3,2]"])


def test_to_xarray() -> None:
    dataset = make().to_xarray()
    assert dict(dataset.sizes) == {"time": T, "player": N, "coordinate": D, "estimated_player": N}
    assert dataset.x.dims == ("time", "player", "coordinate")
    assert dataset.y.dims == ("time", "player", "estimated_player", "coordinate")
    np.testing.assert_array_equal(dataset.x.sel(player=3, coordinate=2), make()["x[3,2]"])
    assert dataset.v.attrs["units"] == "1/s"
    assert dataset.u.attrs["units"] == "1/s or 1/s2"
    assert dataset.attrs["guid"] == "{1}"


def test_repr_is_short() -> None:
    assert repr(make()) == (
        "<Result three players: 7 samples, 0 to 3 s, 44 signals, nash_error 1e-300 at the end>"
    )


def test_missing_signals_are_named() -> None:
    with pytest.raises(ResultError, match=r"^x has indices: name one variable, such as x\[1,1\]$"):
        _ = make()["x"]
    with pytest.raises(ResultError, match="phi was not recorded"):
        _ = make().phi
    with pytest.raises(ResultError, match=r"x\[9,9\] was not recorded"):
        _ = make()["x[9,9]"]
    with pytest.raises(ResultError, match="no sample from 4 to 5 s"):
        make().window(4.0, 5.0)


def test_columns_must_match_the_time() -> None:
    with pytest.raises(ResultError, match="samples"):
        Result(time=np.arange(3.0), columns={"x[1,1]": np.arange(4.0)})


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"must end in \.csv or \.parquet"):
        make().save(tmp_path / "run.txt")
    with pytest.raises(ResultError, match=r"must end in \.csv or \.parquet"):
        load(tmp_path / "run.txt")
    with pytest.raises(ResultError, match="there is no result file"):
        load(tmp_path / "run.csv")
    contents = {"a.csv": "", "b.csv": "x,y\n1,2\n", "c.csv": '"time","x"\n1,a\n', "d.csv": "time,x\n1\n"}
    for name, text in contents.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(ResultError, match="is not a result of this package"):
            load(tmp_path / name)
    (tmp_path / "e.parquet").write_text("no")
    with pytest.raises(ResultError, match="is not a result of this package"):
        load(tmp_path / "e.parquet")
    pd.DataFrame({"time": [0.0]}).to_parquet(tmp_path / "f.parquet")
    with pytest.raises(ResultError, match="is not a result of this package"):
        load(tmp_path / "f.parquet")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="cannot write"):
        make().save(tmp_path / "file" / "run.csv")


def test_names() -> None:
    assert parse_name("x[1,2]") == ("x", (1, 2))
    assert parse_name("nash_error") == ("nash_error", ())
    assert parse_name("der(x[1,2])") == ("der(x[1,2])", ())
    assert split_names("x[1,2], v,center[3],") == ["x[1,2]", "v", "center[3]"]
    assert gather({}, "x", (1, 1)) is None
