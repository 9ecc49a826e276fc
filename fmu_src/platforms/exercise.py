"""Runs each library where that is possible: natively, under Wine or under QEMU, in the tests' small host."""

import os
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from .targets import PlatformError

FOLDER = "Größe 100 %"
"""Of the resources: with letters beyond ASCII, a blank and a sign that means something in a URI."""

WINE = ("wine64", "/usr/lib/wine/wine64", "wine")
QEMU = ("qemu-aarch64", "qemu-aarch64-static")
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
SECONDS = 600.0


@dataclass(frozen=True)
class Run:
    """20 s of the paper's case as one library computes it."""

    times: tuple[float, ...]
    actions: tuple[tuple[float, ...], ...]
    """At each time, all actions."""
    ending: str
    """What the library tells at the end: its steps, evaluations and events."""
    restored: bool
    deserialized: bool
    seconds: float | None
    """Shortest of the runs that were asked for."""


@dataclass(frozen=True)
class Difference:
    """How far two runs are from each other."""

    same_steps: bool
    largest: float
    """Largest difference of an action at any communication point."""
    differs_from: float | None
    """First time at which anything differs; None if the runs are equal bit for bit."""


def launcher(platform: str) -> tuple[list[str], str]:
    """Command in front of the host, and words for it. Raises PlatformError with what is missing."""
    if platform == "linux64":
        return [], "this machine"
    if platform == "win64":
        for name in WINE:
            if found := shutil.which(name):
                return [found], "Wine"
        raise PlatformError("Wine is not installed (Debian: apt-get install wine64)")
    if platform == "aarch64-linux":
        for name in QEMU:
            if found := shutil.which(name):
                if not ARM_LIBRARIES.is_dir():
                    raise PlatformError(f"{ARM_LIBRARIES} is missing (Debian: libc6-arm64-cross)")
                return [found, "-L", str(ARM_LIBRARIES)], "QEMU"
        raise PlatformError("QEMU is not installed (Debian: apt-get install qemu-user libc6-arm64-cross)")
    raise PlatformError("nothing on Linux runs it")


def run_there(
    platform: str, program: Path, *arguments: str, wine_prefix: Path
) -> subprocess.CompletedProcess[bytes]:
    """Run a program of a platform. Raises PlatformError if that is impossible here."""
    command, _ = launcher(platform)
    wine = {"WINEDEBUG": "-all", "WINEPREFIX": str(wine_prefix.resolve()), "LC_ALL": "C.UTF-8"}
    return subprocess.run(
        [*command, str(program), *arguments],
        env={**os.environ, **wine},
        capture_output=True,
        timeout=SECONDS,
        check=False,
    )


def path_there(platform: str, path: Path) -> str:
    """What a file of this machine is called on the platform."""
    return ("Z:" if platform == "win64" else "") + str(path.resolve())


def exercise(
    platform: str, host: Path, library: Path, description: Path, game: Path, *, runs: int = 0
) -> Run:
    """Run the host with a library. Raises PlatformError if that is impossible here or if the host fails."""
    model = ET.parse(description).getroot()  # noqa: S314 (made by this build)
    references = [
        variable.attrib["valueReference"]
        for variable in model.iter("ScalarVariable")
        if variable.attrib["name"].startswith("x[")
    ]
    with tempfile.TemporaryDirectory(prefix="platforms-") as temporary:
        resources = Path(temporary) / FOLDER
        resources.mkdir()
        shutil.copyfile(game, resources / "game.toml")
        uri = "file:///" + quote(path_there(platform, resources).lstrip("/"), safe="/:")
        where = (path_there(platform, library), model.attrib["guid"], uri)
        done = run_there(platform, host, *where, str(runs), *references, wine_prefix=host.parent / "wine")
    if done.returncode != 0:
        said = (done.stdout + done.stderr).decode(errors="replace").strip()
        raise PlatformError(f"{platform}: the host failed with {done.returncode}: {said}")
    return _read(done.stdout.decode().splitlines())


def compare(run: Run, reference: Run) -> Difference:
    """One run held against another with equal times."""
    rows = list(zip(run.times, run.actions, reference.actions, strict=True))
    return Difference(
        same_steps=run.ending == reference.ending,
        largest=max(abs(a - b) for _, row, other in rows for a, b in zip(row, other, strict=True)),
        differs_from=next((t for t, row, other in rows if row != other), None),
    )


def _read(lines: list[str]) -> Run:
    words = [line.split(" ", 1) for line in lines if " " in line]
    points = [tuple(map(float, text.split())) for kind, text in words if kind == "point"]
    told = {kind: text for kind, text in words if kind != "point"}
    return Run(
        times=tuple(point[0] for point in points),
        actions=tuple(point[1:] for point in points),
        ending=told["log"],
        restored=told["restored"] == "yes",
        deserialized=told["deserialized"] == "yes",
        seconds=float(told["seconds"]) if "seconds" in told else None,
    )
