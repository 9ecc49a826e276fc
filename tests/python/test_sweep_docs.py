"""What the pages about sweeps, comparisons, tuning and schedules show runs as shown, in an empty folder."""

import json
import re
import shlex
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from mixed_order_game.cli.app import app

DOCS = Path(__file__).resolve().parents[2] / "python_harness" / "docs"
PAGES = ("sweep.md", "compare.md", "tune.md", "schedule.md")


def blocks(page: str, language: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")


@pytest.mark.parametrize("page", PAGES)
def test_commands(page: str) -> None:
    if page == "schedule.md":
        Path("switching.toml").write_text(blocks(page, "toml")[0])
        Path("gust.csv").write_text(blocks(page, "csv")[1])
    lines = "".join(blocks(page, "console")).splitlines()
    assert lines
    for line in lines:
        name, *arguments = shlex.split(line)
        assert name == "mog"
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, f"{line}: {result.output}"


@pytest.mark.parametrize("page", PAGES)
def test_python(page: str) -> None:
    for block in blocks(page, "python"):
        exec(compile(block, page, "exec"), {})  # noqa: S102 - our own documentation


def test_edges_in_csv() -> None:
    from mixed_order_game import default_fmu, read_model
    from mixed_order_game.fmu.schedule import read_graph_schedule

    Path("edges.csv").write_text(blocks("schedule.md", "csv")[0])
    schedule = read_graph_schedule("edges.csv", read_model(default_fmu()))
    assert schedule.changes(2.0) == {0.5: {"a[1,2]": 0.0, "a[1,3]": 1.0}, 1.0: {"a[1,2]": 1.0}}


def test_results_carry_figures_and_provenance() -> None:
    arguments = ["run", "--set", "k1=12", "--set", "k2=1", "--stop-time", "2", "--output", "run.parquet"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    from mixed_order_game import load

    told = json.loads(pq.read_schema("run.parquet").metadata[b"mixed_order_game"])
    assert told["changed"] == {"k1": 12.0}
    assert told["seed"] is None
    result = load("run.parquet")
    assert result.changed == {"k1": 12.0}
    assert told["metrics"] == result.metrics.as_json()
    assert told["metrics"]["settling_time"] > 0.0
