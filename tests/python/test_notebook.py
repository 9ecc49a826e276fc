"""The tutorial notebook runs from its first cell to its last."""

import warnings
from pathlib import Path
from typing import Any

import nbformat
import pytest

NOTEBOOK = Path(__file__).resolve().parents[2] / "python_harness" / "docs" / "tutorial.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from nbclient import NotebookClient

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    folder = tmp_path_factory.mktemp("notebook")
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # jupyter's own, about event loops and ports
        client.execute()
    return notebook


def outputs(notebook: Any, source: str) -> list[Any]:
    """Outputs of the one cell that contains this text."""
    (cell,) = (each for each in notebook.cells if each.cell_type == "code" and source in each.source)
    return list(cell.outputs)


def test_the_file_holds_no_outputs() -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


def test_results_have_a_repr_and_plots_are_shown(executed: Any) -> None:
    (shown,) = outputs(executed, "result = mog.run(fmu)")
    assert shown.data["text/plain"].startswith("<Result Connectivity control of five vehicles")
    for source in ("plot_plane(result)", "plot_error(runs", "plot_positions(own)"):
        assert "image/png" in outputs(executed, source)[-1].data


def test_it_finds_what_it_tells(executed: Any) -> None:
    (mistake,) = outputs(executed, '"k1 = -10.0"')
    assert "gains.k1 is -10, expected a positive number" in mistake.data["text/plain"]
    (valid,) = outputs(executed, "# no problems")
    assert valid.data["text/plain"] == "()"
    (page,) = outputs(executed, "report(fmu")
    assert page.data["text/plain"] == "(True, True)"
    (claims,) = outputs(executed, "verdict = mog.validate(fmu)")
    assert claims.text.count("holds |") == len(claims.text.splitlines()) - 1 == 8
    assert "Explanation" in claims.text
