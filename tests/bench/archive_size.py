"""Size and loading time of FMUs of the scaling family, with everything exposed and with outputs only.

`python -m tests.bench.archive_size` writes the table of python_harness/docs/archive_size.md. Each step runs
in a process of its own, which is given up after some minutes or beyond some memory.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

from tests.bench.scaling_game import scaling_game

PAGE = Path(__file__).resolve().parents[2] / "python_harness" / "docs" / "archive_size.md"
BEGIN, END = "<!-- sizes: begin -->\n", "<!-- sizes: end -->\n"
PLAYERS = (50, 100, 200)
PATIENCE = 300.0  # s
MEMORY = 8  # GB


def build(archive: Path) -> None:
    """Make the archive from the game beside it."""
    from mixed_order_game import build_fmu

    build_fmu(archive.with_suffix(".toml"), archive)


def read(archive: Path) -> None:
    """Read and validate the description as FMPy does before a simulation."""
    import fmpy

    fmpy.read_model_description(archive)


def start(archive: Path) -> None:
    """Load the library and initialize an instance, without looking at the description's variables."""
    from fmpy.fmi2 import FMU2Slave

    with zipfile.ZipFile(archive) as file, tempfile.TemporaryDirectory() as folder:
        for name in file.namelist():
            if name.startswith(("binaries/", "resources/")):
                file.extract(name, folder)
        with file.open("modelDescription.xml") as description:
            guid = description.read(2000).decode().split('guid="')[1].split('"')[0]
        slave = FMU2Slave(guid=guid, unzipDirectory=folder, modelIdentifier="MixedOrderGame")
        slave.instantiate()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.terminate()
        slave.freeInstance()


STEPS: dict[str, Callable[[Path], None]] = {"build": build, "read": read, "start": start}


def measure(step: str, archive: Path) -> str:
    """Seconds that a step takes without Python's own start, or why it did not end; as text."""
    command = [sys.executable, "-m", "tests.bench.archive_size", "--step", step, str(archive)]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return f"over {PATIENCE:.0f}"
    if result.returncode != 0:
        return f"over {MEMORY} GB" if "MemoryError" in result.stderr else "failed"
    return f"{float(result.stdout):.2f}"


def table() -> str:
    """The rows of all sizes."""
    lines = [
        "| N | `expose` | variables | modelDescription.xml | archive | build | read | start |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for players in PLAYERS:
            for expose in ("outputs", "all"):
                archive = Path(folder) / f"{expose}_{players}.fmu"
                game = scaling_game(players).replace("dimension = 2", f'dimension = 2\nexpose = "{expose}"')
                archive.with_suffix(".toml").write_text(game, encoding="utf-8")
                seconds = {step: measure(step, archive) for step in STEPS}
                with zipfile.ZipFile(archive) as file:
                    size = file.getinfo("modelDescription.xml").file_size
                    with file.open("modelDescription.xml") as description:
                        variables = sum(line.count(b"<ScalarVariable") for line in description)
                cells = [
                    str(players),
                    expose,
                    f"{variables:,}",
                    f"{size / 1e6:.1f} MB",
                    f"{archive.stat().st_size / 1e6:.1f} MB",
                    *seconds.values(),
                ]
                lines.append(f"| {' | '.join(cells)} |")
                print(lines[-1], flush=True)
                archive.unlink()
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run one step, or measure everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", choices=STEPS, help=argparse.SUPPRESS)
    parser.add_argument("archive", type=Path, nargs="?", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.step:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY * 2**30, MEMORY * 2**30))
        import mixed_order_game  # noqa: F401 - importing is not what is measured

        begin = time.perf_counter()
        STEPS[arguments.step](arguments.archive)
        print(time.perf_counter() - begin)
        return
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(before + BEGIN + table() + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
