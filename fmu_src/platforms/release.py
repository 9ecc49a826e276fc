"""Makes all that a release consists of, and tries it: `./dev release`, into build/release.

The sdist; a wheel of this machine's library, made from the sdist and tagged by auditwheel; the wheel of all
platforms; an FMU of every game for all platforms; licences; checksums. Both wheels are installed into empty
environments, of every Python on the path that the package supports, and the demo runs there with nothing else
on the path, no compiler in particular.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from . import build_all
from .targets import PlatformError

ROOT = build_all.ROOT
OUTPUT = ROOT / "build" / "release"
WORK = ROOT / "build" / "release_work"
PLATFORMS = ROOT / "build" / "platforms"
PYTHONS = ("python3.11", "python3.12", "python3.13", "python3.14")
COMPILERS = ("cc", "gcc", "c++", "g++", "clang", "clang++", "cl", "zig")

say = build_all.say


class ReleaseError(Exception):
    """What keeps a release from being made."""


def release(jobs: int, platforms: Sequence[str]) -> None:
    """Make and try everything. Raises ReleaseError, CalledProcessError for what fails."""
    version = judged_version()
    for folder in (OUTPUT, WORK):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    say(f"Release {version}")
    here = native_wheel()
    for interpreter in pythons():
        tried(here, interpreter)
    everywhere = wheel_of_all_platforms(jobs, platforms)
    for interpreter in pythons():
        commands = tried(everywhere, interpreter)
    make_fmus(commands, arm="aarch64-linux" in platforms)
    # the wheel of this machine has its C++ library, the other one those of the cross compiler
    for licenses in (ROOT / "build" / "licenses", PLATFORMS / "licenses"):
        shutil.copytree(licenses, OUTPUT / "licenses", dirs_exist_ok=True)
    files = sorted(path for path in OUTPUT.rglob("*") if path.is_file())
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(OUTPUT)}" for path in files]
    (OUTPUT / "SHA256SUMS").write_text("\n".join(sums) + "\n", encoding="utf-8")
    shutil.rmtree(WORK)
    for path in files:
        if path.parent.name != "licenses":
            say(f"{path.relative_to(ROOT)} ({path.stat().st_size / 1e6:.1f} MB)")


def judged_version() -> str:
    """The version that the sources have. Raises ReleaseError if a tag and the files disagree."""
    from setuptools_scm import get_version

    version = get_version(str(ROOT), **tomllib.loads(text("pyproject.toml"))["tool"]["setuptools_scm"])
    if re.fullmatch(r"\d+\.\d+\.\d+", version):
        for file, line in (
            ("pyproject.toml", f'fallback_version = "{version}"'),
            ("CITATION.cff", f"version: {version}"),
            ("CHANGELOG.md", f"## {version}"),
        ):
            if f"\n{line}" not in text(file):
                raise ReleaseError(f"the tag says {version}, but {file} has no line {line}")
    else:
        say(f"{version}: no release, as no tag such as v1.2.3 is at a clean HEAD")
    return version


def text(name: str) -> str:
    """Of a file of the project."""
    return (ROOT / name).read_text(encoding="utf-8")


def native_wheel() -> Path:
    """Make the sdist, from it a wheel for machines like this one, with the tag that auditwheel finds."""
    say("sdist, and from it the wheel of this machine")
    python("-m", "build", "--no-isolation", "--outdir", WORK, ROOT, MIXED_ORDER_GAME_PLATFORMS="")
    (sdist,) = WORK.glob("*.tar.gz")
    (wheel,) = WORK.glob("*.whl")
    shutil.move(sdist, OUTPUT)
    python("-m", "auditwheel", "repair", "--wheel-dir", OUTPUT, wheel)
    (repaired,) = OUTPUT.glob("*.whl")
    return repaired


def wheel_of_all_platforms(jobs: int, platforms: Sequence[str]) -> Path:
    """Cross-compile and make the wheel that holds it all."""
    build = build_all.Build(PLATFORMS, ROOT / "build", None, jobs)
    if build_all.build_all(build, platforms):
        raise ReleaseError("the libraries of all platforms could not be made")
    say("The wheel of all platforms")
    folder = WORK / "all"
    options = ("--no-isolation", "--wheel", "--outdir", folder)
    python("-m", "build", *options, ROOT, MIXED_ORDER_GAME_PLATFORMS=str(PLATFORMS))
    (wheel,) = folder.iterdir()
    return Path(shutil.move(wheel, OUTPUT))


def pythons() -> Iterator[Path]:
    """Every Python that the package is tried with: this one, and others on the path."""
    yield Path(sys.executable)
    for name in PYTHONS:
        found = shutil.which(name)
        if found is None or name == f"python3.{sys.version_info.minor}":
            continue
        if (
            subprocess.run(
                [found, "-c", "import venv, ensurepip"], capture_output=True, check=False
            ).returncode
            == 0
        ):
            yield Path(found)


def tried(wheel: Path, interpreter: Path) -> Path:
    """Install a wheel into an empty environment and run the demo there; returns the folder of its commands.

    Without extras, then with that of the figures. Nothing but the environment is on the path. Raises
    ReleaseError if a compiler is there all the same.
    """
    environment = WORK / "environment"
    shutil.rmtree(environment, ignore_errors=True)
    subprocess.run([interpreter, "-m", "venv", environment], check=True)
    commands = environment / "bin"
    bare = {"PATH": str(commands), "HOME": str(WORK), "MPLCONFIGDIR": str(WORK)}
    if found := [name for name in COMPILERS if shutil.which(name, path=str(commands))]:
        raise ReleaseError(f"{commands} holds {', '.join(found)}")
    install = ("-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--only-binary", ":all:")
    # the package index may need settings of this machine's environment
    index = {
        name: value
        for name, value in os.environ.items()
        if name.startswith(("PIP_", "SSL_")) or "proxy" in name
    }
    version = subprocess.run(
        [commands / "python", "--version"], capture_output=True, text=True, check=True
    ).stdout
    before, before_bare = megabytes(environment)
    for extra in ("", "[plot]"):
        subprocess.run([commands / "python", *install, f"{wheel}{extra}"], check=True, env=index | bare)
        size, size_bare = megabytes(environment)
        sizes = f"{size - before:.0f} MB, {size_bare - before_bare:.0f} without bytecode"
        began = time.monotonic()
        done = subprocess.run(
            [commands / "mog", "demo", "--output", WORK / f"demo{extra}"],
            capture_output=True,
            text=True,
            check=False,
            env=bare,
            cwd=WORK,
        )
        if done.returncode != 0:
            raise ReleaseError(f"mog demo of {wheel.name}{extra} failed: {done.stdout}{done.stderr}")
        seconds = time.monotonic() - began
        say(f"{wheel.name}{extra}, {version.strip()}: installed {sizes}, demo in {seconds:.0f} s")
    return commands


def megabytes(folder: Path) -> tuple[float, float]:
    """Size of all files below a folder, with the bytecode that pip compiles and without it."""
    sizes = {
        path: path.lstat().st_size / 1e6
        for path in folder.rglob("*")
        if not path.is_dir() and not path.is_symlink()
    }
    return sum(sizes.values()), sum(size for path, size in sizes.items() if path.suffix != ".pyc")


def make_fmus(commands: Path, *, arm: bool) -> None:
    """An FMU of every game for all platforms, and with arm one for Arm Linux, by the installed wheel."""
    say("FMUs of all games")
    folder = OUTPUT / "fmus"
    folder.mkdir()
    for game in sorted((ROOT / "modelDescription" / "games").glob("*.toml")):
        wanted: dict[str, list[str]] = {f"{game.stem}.fmu": []}
        if arm:
            wanted[f"{game.stem}-arm-linux64.fmu"] = ["--arm-linux"]
        for name, options in wanted.items():
            words: list[str | Path] = ["build", game.stem, "--output", folder / name, *options]
            subprocess.run([commands / "mog", *words], check=True, stdout=subprocess.DEVNULL)


def python(*words: str | Path, **variables: str) -> None:
    """Run a module quietly with this interpreter; what it printed is told when it fails."""
    environment: Mapping[str, str] = os.environ | variables
    scripts = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        text=True,
        check=False,
        env={**environment, "PATH": scripts},
    )
    if done.returncode != 0:
        raise ReleaseError(f"{' '.join(map(str, words))} failed:\n{done.stdout}{done.stderr}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line. Returns 0, or 1 for what could not be made."""
    parser = argparse.ArgumentParser(
        prog="./dev release", description="Make and try what a release consists of."
    )
    parser.add_argument(
        "--platform",
        action="append",
        choices=build_all.PLATFORMS,
        dest="platforms",
        help="for a trial: this platform alone; repeatable",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    options = parser.parse_args(arguments)
    try:
        release(options.jobs, options.platforms or build_all.PLATFORMS)
    except (ReleaseError, PlatformError, OSError, subprocess.CalledProcessError) as error:
        say(f"release: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
