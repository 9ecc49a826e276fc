"""The reference results in the archive: laid out as FMI-LS-REF has it, and right, as the oracle tells."""

import csv
import io
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path, PurePosixPath

import fmpy
import numpy as np
import pytest

from mixed_order_game import build_fmu
from tests.bench.scaling_game import scaling_game
from tests.conftest import GAMES, FmuOf
from tests.oracle.make_reference import CASES, REFERENCE

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
BOUND = 2e-7
"""Of a signal's largest value, at least of 1; the results have a relative tolerance of 1e-10."""


def element(archive: zipfile.ZipFile, name: str) -> ET.Element:
    return ET.fromstring(archive.read(f"{FOLDER}/{name}"))  # noqa: S314 - our own file


def test_manifest_names_what_is_there(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        root = element(archive, "fmi-ls-manifest.xml")
        assert root.tag == "fmiReferences"
        assert root.get(f"{NAMESPACE}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
        assert root.get(f"{NAMESPACE}fmi-ls-version") == "1.0.0-alpha.1"
        description = "Layered Standard providing information on related files included in an FMU."
        assert root.get(f"{NAMESPACE}fmi-ls-description") == description
        members = set(archive.namelist())
        files = {}
        for related in root.iterfind("Related"):
            source = PurePosixPath(FOLDER, related.attrib["source"])
            parts: list[str] = []
            for part in source.parts:
                if part == "..":
                    parts.pop()
                else:
                    parts.append(part)
            files["/".join(parts)] = related.attrib["role"]
    assert set(files) <= members
    assert set(files.values()) == {"experiment/validation", "result", "model"}
    assert {name for name in members if name.startswith("extra/")} - {f"{FOLDER}/fmi-ls-manifest.xml"} <= set(
        files
    )


def test_experiment_is_the_default_one(fmu: Path) -> None:
    default = fmpy.read_model_description(str(fmu)).defaultExperiment
    with zipfile.ZipFile(fmu) as archive:
        (experiment,) = element(archive, "default.exp").iterfind("Experiment")
        settings = experiment.find("TransientSimulation")
        references = experiment.find("References")
        assert settings is not None
        assert references is not None
        assert f"{FOLDER}/{references.attrib['source']}" in archive.namelist()
        assert settings.get("startTime") == "0"
        assert float(settings.attrib["stopTime"]) == float(default.stopTime)
        results = table(fmu)
        step = float(settings.attrib["stepSize"])
    np.testing.assert_allclose(np.diff(results["time"]), step, atol=1e-12)
    assert results["time"][-1] == float(default.stopTime)


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if not case.changes])
def test_agrees_with_the_oracle(name: str, fmu_of: FmuOf) -> None:
    fmu = fmu_of(Path(CASES[name].game).stem)
    results = table(fmu)
    outputs = [
        v.name for v in fmpy.read_model_description(str(fmu)).modelVariables if v.causality == "output"
    ]
    assert list(results) == ["time", *outputs]
    with np.load(REFERENCE / f"{name}.npz") as file:
        reference = {key: file[key] for key in ("t", "x", "v", "u", "nash_error")}
    ours, theirs = np.nonzero(np.abs(results["time"][:, None] - reference["t"][None, :]) < 1e-9)
    assert len(ours) > 10
    for output in outputs:
        stem, _, index = output.partition("[")
        expected = reference[stem]
        scale = max(1.0, float(np.abs(expected).max()))
        if index:
            i, entry = (int(part) - 1 for part in index.rstrip("]").split(","))
            expected = expected[:, i, entry]
        error = np.abs(results[output][ours] - expected[theirs]).max() / scale
        assert error < BOUND, f"{output}: {error:.1e}"


def test_a_large_game_goes_without(tmp_path: Path) -> None:
    game = tmp_path / "fifty.toml"
    game.write_text(scaling_game(50), encoding="utf-8")
    with zipfile.ZipFile(build_fmu(game, tmp_path / "fifty.fmu")) as archive:
        assert not [name for name in archive.namelist() if name.startswith("extra/")]


def test_a_game_that_cannot_run_to_the_end_goes_without(tmp_path: Path) -> None:
    text = (GAMES / "two_scalar_players.toml").read_text(encoding="utf-8")
    explosive = text.replace("square = [[1, -0.10]]", "square = [[1, 1e6]]").replace(
        "x0 = -1.62", "x0 = 1.62"
    )
    assert explosive.count("1e6") == 1
    game = tmp_path / "explosive.toml"
    game.write_text(explosive, encoding="utf-8")
    with zipfile.ZipFile(build_fmu(game, tmp_path / "explosive.fmu")) as archive:
        assert not [name for name in archive.namelist() if name.startswith("extra/")]


def table(fmu: Path) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read(f"{FOLDER}/default.csv").decode()
    header, *rows = csv.reader(io.StringIO(text))
    return dict(zip(header, np.array(rows, dtype=np.float64).T, strict=True))
