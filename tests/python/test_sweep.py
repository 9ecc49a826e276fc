"""Sweeps: what a row stands for, the files, interruptions of every kind, the table and its figures."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from matplotlib.colors import LogNorm

from mixed_order_game import MixedOrderGameError, ModelError, PlotError, ResultError, VariableError
from mixed_order_game.game.graphs import GraphError, graphs_of_text
from mixed_order_game.results.style import new_axes
from mixed_order_game.studies.designs import DesignError, Range
from mixed_order_game.studies.sampler import Sampler, Settings
from mixed_order_game.studies.sampling import Sampling
from mixed_order_game.studies.sweep.conduct import connected_graphs_example, sweep
from mixed_order_game.studies.sweep.definition import Sweep
from mixed_order_game.studies.sweep.figures import _image, check_heat_map, plot_edges, plot_heat_map
from mixed_order_game.studies.sweep.store import SweepError
from mixed_order_game.studies.sweep.table import SweepResult, load_sweep
from mixed_order_game.studies.worker import PoolError
from tests.python import sweep_workers

SHORT = Settings(stop_time=0.2)


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "notes"
    folder.mkdir()
    monkeypatch.setenv(sweep_workers.FOLDER, str(folder))
    return folder


def runs_of(notes: Path) -> dict[int, int]:
    """Row -> how often it was run."""
    return {int(path.stem): len(path.read_text().split()) for path in notes.glob("*.run")}


@pytest.fixture(scope="module")
def swept(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> SweepResult:
    """Two graphs, two initial states, four samples of two ranges, three values of a grid: 48 rows."""
    definition = Sweep(
        fmu=fmu,
        fixed={"perturbed": False, "disturbance_bias": 0.25},
        grid={"k1": (5, 10.0, 20.0)},
        ranges={"k2": Range(0.5, 2.0), "k3": Range(20.0, 200.0, logarithmic=True)},
        samples=4,
        sampling=Sampling.SOBOL,
        graphs=(*graphs_of_text("ring", 5), *graphs_of_text("1-2,1-3,1-4:0.5,1-5", 5)),
        initial_states=2,
        initial_velocities=Range(-1.0, 1.0),
        seed=11,
        settings=Settings(stop_time=3.0),
    )
    return sweep(definition, tmp_path_factory.mktemp("sweeps") / "all", jobs=2)


def test_every_combination(swept: SweepResult) -> None:
    assert len(swept) == swept.rows == 48
    assert swept.complete
    assert not swept.failed.size
    assert swept.axes[:4] == ("graph", "graph_edges", "graph_connectivity", "initial_state")
    assert swept.axes[-4:] == ("sample", "k2", "k3", "k1")
    combinations = {
        tuple(row[name] for name in ("graph", "initial_state", "sample", "k1"))
        for row in swept.table.to_pylist()
    }
    assert len(combinations) == 48
    assert set(swept["k1"]) == {5.0, 10.0, 20.0}
    assert len(set(swept["k3"])) == 4
    assert len(set(swept["v0[4,1]"])) == 2
    assert swept.folder.joinpath("results.parquet").is_file()
    assert not swept.folder.joinpath("rows").exists()


def test_rows_are_what_they_say(fmu: Path, swept: SweepResult) -> None:
    row = swept.table.to_pylist()[29]
    graph = "1-2 1-3 1-4:0.5 1-5"
    assert row["graph"] == graph
    values = graphs_of_text(graph, 5)[0].start_values
    with Sampler(fmu) as sampler:
        varied = {name: value for name, value in row.items() if "[" in name or name in ("k1", "k2", "k3")}
        fixed = {f"disturbance_bias[{i},{k}]": 0.25 for i in range(1, 6) for k in (1, 2)}
        start = values(sampler.model) | varied | fixed | {"perturbed": False}
        expected = sampler.measure(start, Settings(stop_time=3.0))
    assert row["settling_time"] == expected.settling_time
    assert row["control_energy"] == expected.control_energy
    assert row["final_error"] == expected.final_error
    assert row["status"] == "ok"
    assert row["cpu_seconds"] > 0.0


def test_provenance_is_in_the_files(swept: SweepResult) -> None:
    metadata = pq.read_schema(swept.folder / "results.parquet").metadata
    told = json.loads(metadata[b"mixed_order_game_sweep"])
    assert told["seed"] == 11
    assert told["guid"].startswith("{")
    assert told["changed"]["disturbance_bias[5,2]"] == 0.25
    assert told["changed"]["perturbed"] is False
    assert told["definition"]["ranges"]["k3"] == {"low": 20.0, "high": 200.0, "logarithmic": True}
    assert swept.definition["fingerprint"] == load_sweep(swept.folder).definition["fingerprint"]


def test_finished_sweep_is_not_run_again(fmu: Path, tmp_path: Path, notes: Path) -> None:
    definition = Sweep(fmu=fmu, grid={"k1": (5.0, 6.0, 7.0)}, settings=SHORT)
    first = sweep(definition, tmp_path / "s", jobs=1, work=sweep_workers.noted)
    again = sweep(definition, tmp_path / "s", jobs=1, work=sweep_workers.dies)
    assert again.table.equals(first.table)
    assert runs_of(notes) == {0: 1, 1: 1, 2: 1}
    other = Sweep(fmu=fmu, grid={"k1": (5.0, 6.0, 8.0)}, settings=SHORT)
    with pytest.raises(SweepError, match="holds another sweep"):
        sweep(other, tmp_path / "s", jobs=1)
    restarted = sweep(other, tmp_path / "s", jobs=1, restart=True)
    assert set(restarted["k1"]) == {5.0, 6.0, 8.0}


def test_seed(fmu: Path) -> None:
    def values(seed: int) -> list[object]:
        options = {"ranges": {"k1": Range(5.0, 20.0)}, "samples": 3, "initial_states": 2, "seed": seed}
        definition = Sweep(fmu=fmu, **options)  # type: ignore[arg-type]
        return [definition.case(row).values for row in range(definition.rows)]

    assert values(1) == values(1)
    assert values(1) != values(2)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_interrupted_sweep_resumes(how: signal.Signals, fmu: Path, tmp_path: Path, notes: Path) -> None:
    script = tmp_path / "start.py"
    script.write_text(
        "import sys\n"
        "from pathlib import Path\n"
        "from mixed_order_game.studies.sampler import Settings\n"
        "from mixed_order_game.studies.sweep.conduct import sweep\n"
        "from mixed_order_game.studies.sweep.definition import Sweep\n"
        "from tests.python import sweep_workers\n"
        "if __name__ == '__main__':\n"
        "    grid = {'k1': tuple(5.0 + 0.1 * k for k in range(200))}\n"
        "    definition = Sweep(fmu=Path(sys.argv[1]), grid=grid, settings=Settings(stop_time=0.2))\n"
        "    sweep(definition, sys.argv[2], jobs=2, work=sweep_workers.slow)\n"
    )
    folder = tmp_path / "s"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, str(script), str(fmu), str(folder)]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120.0
        while len(list(folder.glob("rows/*.parquet"))) < 3:
            assert time.monotonic() < deadline
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.02)
        workers = {int(pid) for path in notes.glob("*.run") for pid in path.read_text().split()}
        process.send_signal(how)  # once: it must not be dropped
        process.communicate(timeout=60.0)
        assert process.returncode == -how
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < deadline, "workers outlive the sweep"
        time.sleep(0.02)
    kept = set(
        np.concatenate([pq.read_table(path)["row"] for path in folder.glob("rows/*.parquet")]).tolist()
    )
    assert 0 < len(kept) < 200
    before = runs_of(notes)

    grid = {"k1": tuple(5.0 + 0.1 * k for k in range(200))}
    told: list[tuple[int, int]] = []
    result = sweep(
        Sweep(fmu=fmu, grid=grid, settings=SHORT),
        folder,
        jobs=2,
        work=sweep_workers.noted,
        progress=lambda done, total: told.append((done, total)),
    )
    assert told[0] == (len(kept), 200)
    assert told[-1] == (200, 200)
    np.testing.assert_array_equal(result.table["row"], np.arange(200))
    after = runs_of(notes)
    assert all(after[row] == before[row] for row in kept)


def test_two_sweeps_do_not_share_a_folder(fmu: Path, tmp_path: Path) -> None:
    from mixed_order_game.studies.sweep.store import locked

    with locked(tmp_path / "s"), pytest.raises(SweepError, match="another sweep is at work"):
        sweep(Sweep(fmu=fmu, settings=SHORT), tmp_path / "s")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").touch()
    with pytest.raises(SweepError, match="is not empty and holds no sweep"):
        sweep(Sweep(fmu=fmu, settings=SHORT), tmp_path / "mine")
    with pytest.raises(ResultError, match="cannot write into"):
        sweep(Sweep(fmu=fmu, settings=SHORT), tmp_path / "mine" / "letter.txt")
    with pytest.raises(SweepError, match="holds no sweep"):
        load_sweep(tmp_path)


def test_folder_of_a_start_that_was_killed(fmu: Path, tmp_path: Path) -> None:
    """Killed while it wrote its first file, and later while it wrote rows."""
    folder = tmp_path / "s"

    def killed_while_writing(name: str) -> None:
        text = (
            "import os, pathlib\n"
            "from mixed_order_game.files.writing import write_whole\n"
            f"write_whole(pathlib.Path({str(folder / name)!r}), lambda _: os.kill(os.getpid(), 9))"
        )
        assert subprocess.run([sys.executable, "-c", text], check=False).returncode == -signal.SIGKILL

    killed_while_writing("sweep.json")
    assert len(list(folder.iterdir())) == 1
    assert sweep(Sweep(fmu=fmu, grid={"k1": (5.0, 6.0)}, settings=SHORT), folder, jobs=1).complete
    killed_while_writing("rows/00000000.parquet")
    other = Sweep(fmu=fmu, grid={"k1": (5.0, 7.0)}, settings=SHORT)
    assert sweep(other, folder, jobs=1, restart=True).complete
    assert {path.name for path in folder.iterdir()} <= {".lock", "sweep.json", "results.parquet"}


def test_runs_that_the_fmu_gives_up(fmu: Path, tmp_path: Path) -> None:
    values = {"robust": False, "x0[2,1]": 1000.0}
    definition = Sweep(fmu=fmu, fixed=values, grid={"k1": (0.1, 10.0), "perturbed": (True, False)})
    result = sweep(definition, tmp_path / "s", jobs=1)
    assert result.failed.tolist() == [0, 2]
    assert np.isnan(result["final_error"][0])
    assert not np.isnan(result["final_error"][3])
    assert "refused" in repr(result)
    assert result.misses(1e6).tolist() == [0, 2]
    summary = {each.name: each for each in result.summary()}
    assert summary["final_error"].count == 2
    assert len(result["perturbed"]) == 4


@pytest.mark.parametrize(
    ("options", "error", "told"),
    [
        ({"fixed": {"k5": 1.0}}, VariableError, "there is no variable k5"),
        ({"grid": {"k1": (1.0, -1.0)}}, VariableError, "expected a positive number"),
        ({"grid": {"x": (1.0,)}}, VariableError, "cannot be set"),
        ({"grid": {"k1": ()}}, DesignError, "empty"),
        ({"grid": {"k1": (1.0,)}, "fixed": {"k1": 2.0}}, DesignError, "k1 is set twice"),
        (
            {"grid": {"a[1,2]": (1.0,)}, "fixed": {"a": 2.0}},
            DesignError,
            "a[1,2] is set by both a and a[1,2]",
        ),
        ({"ranges": {"k1": Range(1.0, 2.0)}}, DesignError, "number of samples"),
        ({"samples": 4}, DesignError, "ranges"),
        ({"seed": -1}, DesignError, "seed = -1"),
        ({"neighbourhood": 0.0}, DesignError, "neighbourhood"),
        ({"graphs": tuple(graphs_of_text("ring", 4))}, GraphError, "4 players, the game has 5"),
        (
            {"graphs": tuple(graphs_of_text("ring", 5)), "grid": {"a[1,2]": (0.5,)}},
            DesignError,
            "graphs or initial states",
        ),
        ({"initial_states": 2, "fixed": {"x0": 0.0}}, DesignError, "graphs or initial states"),
        (
            {"grid": {f"x0[{i},1]": tuple(range(100)) for i in range(1, 6)}},
            DesignError,
            "10000000000 rows",
        ),
    ],
)
def test_definitions_that_make_no_sense(
    options: dict[str, object], error: type[MixedOrderGameError], told: str, fmu: Path
) -> None:
    with pytest.raises(error) as raised:
        Sweep(fmu=fmu, **options)  # type: ignore[arg-type]
    assert told in str(raised.value)


def test_what_cannot_be_had(fmu: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="there is no FMU"):
        Sweep(fmu=tmp_path / "none.fmu")
    with pytest.raises(PoolError, match="jobs = 0"):
        sweep(Sweep(fmu=fmu), tmp_path / "s", jobs=0)


def test_summary_and_medians(swept: SweepResult) -> None:
    summary = {each.name: each for each in swept.summary()}
    settling = summary["settling_time"]
    values = swept["settling_time"]
    assert settling.most == np.nanmax(values) == values[settling.row_of_most]
    assert settling.median == np.nanmedian(values)
    medians = swept.medians(["k1"], "control_peak")
    assert list(medians) == [(5.0,), (10.0,), (20.0,)]
    assert medians[5.0,] == np.median(swept["control_peak"][swept["k1"] == 5.0])
    assert len(swept.medians(["k1", "initial_state"], "events")) == 6
    assert len(swept.to_pandas()) == 48
    for column in ("nothing", "graph"):
        with pytest.raises(ResultError, match=column):
            swept[column]


def test_heat_maps(swept: SweepResult, tmp_path: Path) -> None:
    from mixed_order_game.results.plot import save_figure

    axes = plot_heat_map(swept, "k1", "k3", "control_energy")
    (image,) = axes.images
    medians = np.asarray(image.get_array())
    assert medians.shape == (4, 3)
    chosen = (swept["k1"] == 20.0) & (swept["k3"] == np.unique(swept["k3"])[1])
    assert medians[1, 2] == pytest.approx(np.median(swept["control_energy"][chosen]))
    assert save_figure(axes, tmp_path / "map.pdf").stat().st_size > 1000
    (edges,) = plot_edges(swept, "settling_time").images
    array = np.ma.filled(np.ma.masked_invalid(np.asarray(edges.get_array(), dtype=float)), np.nan)
    np.testing.assert_array_equal(array, array.T)
    assert np.isnan(array[0, 0])
    assert np.isnan(array[1, 3])
    assert not np.isnan(array[0, 1])
    with pytest.raises(PlotError, match="does not vary"):
        plot_heat_map(one_k1(swept), "k1", "k2", "events")


@pytest.mark.parametrize(
    ("values", "logarithmic", "ticks"),
    [([0.5, 0.5, 0.5], False, [0.5]), ([1.0, 3.0, 9.0], False, None), ([1.0, 3.0, 20.0], True, None)],
)
def test_colours_of_heat_maps(values: list[float], *, logarithmic: bool, ticks: list[float] | None) -> None:
    """Logarithmic beyond a decade; one tick for one value; cells without a value are explained."""
    axes = new_axes()
    _image(axes, np.array([[*values, np.nan]]), "final_error")
    (image,) = axes.images
    assert isinstance(image.norm, LogNorm) == logarithmic
    assert image.colorbar is not None
    assert ticks is None or image.colorbar.get_ticks().tolist() == ticks
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["no value"]


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("k1", "k2", "nonsense"), "no column nonsense"),
        (("graph", "k2", "events"), "graph is text"),
        (("k1", "k4", "events"), "k4 does not vary"),
    ],
)
def test_heat_maps_are_judged_before_the_sweep(names: tuple[str, str, str], told: str, fmu: Path) -> None:
    definition = Sweep(
        fmu=fmu,
        grid={"k1": (5.0, 6.0), "k4": (50.0, 50.0)},
        ranges={"k2": Range(0.5, 2.0)},
        samples=2,
        graphs=tuple(graphs_of_text("ring", 5)),
        initial_states=2,
    )
    with pytest.raises((ResultError, PlotError), match=told):
        check_heat_map(definition, *names)
    check_heat_map(definition, "k1", "k2", "settling_time")
    check_heat_map(definition, "x0[3,1]", "final_error", "k4")
    assert [definition.varies(name) for name in ("graph_edges", "initial_state", "sample")] == [
        False,
        True,
        True,
    ]


def one_k1(result: SweepResult) -> SweepResult:
    """The rows of one value of k1."""
    return SweepResult(result.folder, result.table.filter((result["k1"] == 5.0).tolist()), result.definition)


def test_example_on_some_of_its_graphs(fmu: Path, tmp_path: Path) -> None:
    example = connected_graphs_example(fmu)
    assert example.rows == 728
    assert example.neighbourhood == 0.00125
    assert example.settings.settle_time == 16.0
    assert example.fixed == {"robust": True, "perturbed": True}
    few = Sweep(
        fmu=fmu,
        fixed=example.fixed,
        graphs=example.graphs[::91],
        settings=example.settings,
        neighbourhood=example.neighbourhood,
    )
    result = sweep(few, tmp_path / "s", jobs=2)
    assert len(result) == 8
    assert result.misses(0.00125).size == 0
    assert np.all(result["final_error"] > 0.0011)
    assert np.all(result["settling_time"] < 2.0)
    assert len(set(result["graph_edges"])) >= 4
