"""One FMU for Windows, Linux, macOS and 64-bit Arm Linux, made on a Linux machine: `./dev fmu-all`.

python -m fmu_src.platforms.build_all, in the folder of the project, with an interpreter that has fmpy (its
FMI headers). The native build must be there: it makes modelDescription.xml. A platform that cannot be made is
named at the end, and the others are made all the same.
"""

import argparse
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from xml.etree import ElementTree as ET

from . import binary_table, exercise
from .fingerprint import fingerprint
from .mach_o import keep_exports, universal
from .sources import PUGIXML, SUNDIALS, sources
from .targets import LIEF, TARGETS, ZIGLANG, PlatformError, Target

ROOT = Path(__file__).resolve().parents[2]
GAME = ROOT / "modelDescription" / "games" / "five_vehicles.toml"
PACKAGING = ROOT / "python_harness" / "mixed_order_game" / "fmu" / "packaging.py"

PLATFORMS = ("linux64", "win64", "darwin64", "aarch64-linux")
ARCHIVE = "MixedOrderGame.fmu"
ARM_ARCHIVE = "MixedOrderGame-arm-linux64.fmu"
"""For 64-bit Arm Linux, where most importers look in linux64 too."""

TOOL = "mixed-order-game-description"
"""Host tool of installed packages: wheels take it from the folder tools."""

WRAPPER = """\
#!/bin/sh
export ZIG_GLOBAL_CACHE_DIR="${{ZIG_GLOBAL_CACHE_DIR:-{cache}}}"
for argument do
  shift
  # the compiler knows the levels of x86-64 by names with underscores
  case $argument in -march=x86-64-v*) argument=-march=x86_64_v${{argument##*v}} ;; esac
  set -- "$@" "$argument"
done
exec {zig} {command} "$@"
"""

LICENSES = {
    "libc++": "lib/libcxx/LICENSE.TXT",
    "libc++abi": "lib/libcxxabi/LICENSE.TXT",
    "libunwind": "lib/libunwind/LICENSE.TXT",
    "zig-compiler-rt": "LICENSE",
    "mingw-w64": "lib/libc/mingw/COPYING",
    "glibc": "lib/libc/glibc/LICENSES",
    "musl": "lib/libc/musl/COPYRIGHT",
}
"""What the compiler links into the libraries: names in the archive, and files of the ziglang package."""

HEADERS_ONLY = ("eigen", "pegtl", "tomlplusplus")
"""Licences that the native build has collected."""


def say(text: str) -> None:
    """Tell the user."""
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


class Build:
    """The folder of the build, and what is needed to make a library in it."""

    def __init__(self, folder: Path, native: Path, sundials: Path | None, jobs: int) -> None:
        self.folder = folder
        self.native = native
        self.jobs = jobs
        self.description = native / "fmu" / "modelDescription.xml"
        if not self.description.is_file():
            raise PlatformError(f"{self.description} is missing: run ./dev build first")
        self.version = ET.parse(self.description).getroot().attrib["version"]  # noqa: S314 - our own
        self.headers = _fmi_headers()
        folder.mkdir(parents=True, exist_ok=True)
        self.ziglang = self._install_packages()
        self._write_wrappers()
        self.sundials, origin = sources(SUNDIALS, folder / "sources", sundials)
        say(origin)
        self.pugixml, origin = sources(PUGIXML, folder / "sources")
        say(origin)
        self.include = self._header_folders()

    def compile(self, target: Target) -> None:
        """Compile library and host of one target. Raises PlatformError with the place of the log."""
        say(f"Compiling for {target.name}")
        here = self.folder / target.name
        log = self.folder / f"{target.name}.log"
        options: dict[str, str | Path] = {
            "CMAKE_BUILD_TYPE": "Release",
            "CMAKE_TOOLCHAIN_FILE": ROOT / "fmu_src" / "platforms" / "zig.cmake",
            "ZIG_TARGET": target.triple,
            "ZIG_TOOLS": self.folder / "commands",
            "SUNDIALS_SOURCE": self.sundials,
            "PUGIXML_SOURCE": self.pugixml,
            "FMI2_HEADERS_DIR": self.headers,
            "MIXED_ORDER_GAME_VERSION": self.version,
        }
        if self.include is not None:
            options["TOMLPLUSPLUS_INCLUDE_DIR"] = self.include
            options["PEGTL_INCLUDE_DIR"] = self.include
        definitions = [f"-D{name}={value}" for name, value in options.items()]
        commands: list[list[str | Path]] = [
            ["cmake", "-S", ROOT / "fmu_src" / "platforms", "-B", here, *definitions],
            ["cmake", "--build", here, "--parallel", str(self.jobs)],
        ]
        with log.open("w", encoding="utf-8") as output:
            for command in commands:
                if subprocess.run(command, stdout=output, stderr=output, check=False).returncode != 0:
                    raise PlatformError(f"{target.name} could not be compiled, see {log}")

    def library(self, target: Target) -> Path:
        """Where the compiler leaves a library."""
        return self.folder / target.name / "fmu_src" / target.library

    def host(self, platform: str) -> Path:
        """The small FMI host for a platform."""
        return self.folder / platform / ("host.exe" if platform == "win64" else "host")

    def tool(self, platform: str) -> Path:
        """The host tool for a platform."""
        return self.folder / "tools" / platform / (TOOL + (".exe" if platform == "win64" else ""))

    def finish(self, platform: str) -> Path:
        """Put a compiled platform's library and host tool into binaries/<platform>/ and tools/<platform>/."""
        parts = [target for target in TARGETS if target.platform == platform]
        library = self.folder / "binaries" / platform / parts[0].library
        library.parent.mkdir(parents=True, exist_ok=True)
        tool = self.tool(platform)
        tool.parent.mkdir(parents=True, exist_ok=True)
        made = [self.folder / target.name / "modelDescription" / tool.name for target in parts]
        if platform == "darwin64":
            library.write_bytes(
                universal(keep_exports(self.library(target).read_bytes(), "_fmi2") for target in parts)
            )
            tool.write_bytes(universal(path.read_bytes() for path in made))
        else:
            shutil.copyfile(self.library(parts[0]), library)
            shutil.copyfile(made[0], tool)
        tool.chmod(0o755)
        return library

    def collect_licenses(self) -> Path:
        """Licence texts of everything linked into any of the libraries, in one folder."""
        folder = self.folder / "licenses"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        texts = {
            "mixed-order-game": ROOT / "LICENSE",
            "sundials": self.sundials / "LICENSE",
            "pugixml": self.pugixml / "LICENSE.md",
            **{name: self.native / "licenses" / f"{name}.txt" for name in HEADERS_ONLY},
            **{name: self.ziglang / path for name, path in LICENSES.items()},
        }
        for name, path in texts.items():
            if not path.is_file():
                raise PlatformError(f"the licence of {name} is missing: {path}")
            shutil.copyfile(path, folder / f"{name}.txt")
        return folder

    def pack(self, name: str, binaries: Mapping[str, Path], licenses: Path) -> Path:
        """Make an archive from libraries by platform folder."""
        archive = self.folder / name
        command: list[str | Path] = [
            sys.executable,
            PACKAGING,
            "--model-description",
            self.description,
            "--game",
            GAME,
        ]
        for platform, library in binaries.items():
            command += ["--binary", f"{platform}={library}"]
        command += ["--documentation", ROOT / "modelDescription" / "documentation", "--licenses", licenses]
        command += ["--icon", ROOT / "modelDescription" / "model.png"]
        command += ["--extra", self.description.parent / "extra", "--output", archive]
        subprocess.run(command, check=True)
        return archive

    def _install_packages(self) -> Path:
        packages = self.folder / "packages"
        stamp = packages / "installed"
        wanted = f"{ZIGLANG} {LIEF}"
        if not stamp.is_file() or stamp.read_text(encoding="utf-8") != wanted:
            say(f"Installing {wanted} into {packages}")
            shutil.rmtree(packages, ignore_errors=True)
            subprocess.run(
                [sys.executable, "-m", "pip", "install", "--quiet", "--target", packages, ZIGLANG, LIEF],
                check=True,
            )
            stamp.write_text(wanted, encoding="utf-8")
        sys.path.append(str(packages))
        return packages / "ziglang"

    def _write_wrappers(self) -> None:
        """Commands for CMake, which wants one word for a compiler."""
        commands = self.folder / "commands"
        commands.mkdir(exist_ok=True)
        for command in ("cc", "c++", "ar", "ranlib", "rc"):
            path = commands / command
            text = WRAPPER.format(cache=self.folder / "zig-cache", zig=self.ziglang / "zig", command=command)
            if not path.is_file() or path.read_text(encoding="utf-8") != text:
                path.write_text(text, encoding="utf-8")
                path.chmod(0o755)

    def _header_folders(self) -> Path | None:
        """A folder with links to packages of headers, because the rest of /usr/include is of this machine.

        Eigen has a folder of its own already. What is missing CMake fetches as a pinned release.
        """
        include = self.folder / "include"
        include.mkdir(exist_ok=True)
        found = True
        for name in ("toml++", "tao"):
            link = include / name
            places = (Path("/usr/include") / name, Path("/usr/local/include") / name)
            headers = next((place for place in places if place.is_dir()), None)
            if headers is not None and not link.exists():
                link.symlink_to(headers)
            found = found and headers is not None
        return include if found else None


def _fmi_headers() -> Path:
    found = importlib.util.find_spec("fmpy")
    if found is None or found.origin is None:
        raise PlatformError(f"fmpy, which carries the FMI headers, is missing from {sys.executable}")
    return Path(found.origin).parent / "c-code"


def examine(build: Build, libraries: Mapping[str, Path]) -> tuple[list[binary_table.Image], list[str]]:
    """What each library exports and needs, and what is wrong with it."""
    functions = binary_table.functions_of_the_standard(build.headers)
    rows = [
        image for platform, library in libraries.items() for image in binary_table.images(platform, library)
    ]
    return rows, [complaint for row in rows for complaint in binary_table.complaints(row, functions)]


def compare_runs(
    build: Build, libraries: Mapping[str, Path]
) -> tuple[dict[str, dict[str, object]], list[str]]:
    """Run what can be run; each platform's result, and what is wrong."""
    results: dict[str, dict[str, object]] = {}
    wrong = []
    reference = None
    for platform, library in libraries.items():
        try:
            _, where = exercise.launcher(platform)
        except PlatformError as reason:
            results[platform] = {"run": f"built, not run: {reason}"}
            continue
        try:
            run = exercise.exercise(platform, build.host(platform), library, build.description, GAME)
        except (PlatformError, subprocess.TimeoutExpired) as error:
            results[platform] = {"run": "failed"}
            wrong.append(str(error))
            continue
        results[platform] = {"run": where, "ending": run.ending, "restored": run.restored}
        results[platform]["deserialized"] = run.deserialized
        if not (run.restored and run.deserialized):
            wrong.append(f"{platform}: the run from a saved state differs from the one it was saved in")
        if platform == "linux64":
            reference = run
        elif reference is not None:
            results[platform] |= asdict(exercise.compare(run, reference))
    return results, wrong


def comparison_table(results: Mapping[str, Mapping[str, object]]) -> str:
    """The results of compare_runs as a table in Markdown."""
    lines = [
        "| platform | run on | from a saved state | same steps | largest difference of x | first at |",
        "|---|---|---|---|---|---|",
    ]
    for platform, result in results.items():
        cells = [platform, str(result["run"])]
        if "restored" in result:
            cells.append("same bits" if result["restored"] and result["deserialized"] else "DIFFERS")
        if "same_steps" in result:
            first = result["differs_from"]
            cells.append("yes" if result["same_steps"] else "no")
            cells.append("none" if first is None else f"{result['largest']:.2g}")
            cells.append("" if first is None else f"{first:.1f} s")
        cells += [""] * (6 - len(cells))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def build_all(build: Build, platforms: Collection[str] = PLATFORMS) -> int:
    """Make everything that can be made. Returns the number of things that went wrong."""
    wrong = []
    failed = set()
    for target in (target for target in TARGETS if target.platform in platforms):
        try:
            build.compile(target)
        except PlatformError as error:
            wrong.append(str(error))
            failed.add(target.platform)
    for folder in ("binaries", "tools"):
        shutil.rmtree(build.folder / folder, ignore_errors=True)
    libraries = {
        platform: build.finish(platform)
        for platform in PLATFORMS
        if platform in platforms and platform not in failed
    }
    if not libraries:
        raise PlatformError("; ".join(wrong))
    licenses = build.collect_licenses()
    archives = [build.pack(ARCHIVE, libraries, licenses)]
    if "aarch64-linux" in libraries:
        arm = libraries["aarch64-linux"]
        archives.append(build.pack(ARM_ARCHIVE, {"aarch64-linux": arm, "linux64": arm}, licenses))

    rows, complaints = examine(build, libraries)
    results, failures = compare_runs(build, libraries)
    wrong += complaints + failures
    report = "\n\n".join([binary_table.table(rows), comparison_table(results)])
    (build.folder / "report.md").write_text(report + "\n", encoding="utf-8")
    facts = {
        "sources": fingerprint(ROOT),
        "images": [asdict(row) for row in rows],
        "runs": results,
        "wrong": wrong,
    }
    (build.folder / "report.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(report + "\n")
    for archive in archives:
        say(f"{archive} ({archive.stat().st_size / 1e6:.1f} MB)")
    for text in wrong:
        say(f"wrong: {text}")
    if lacking := [platform for platform in PLATFORMS if platform not in libraries]:
        say(f"The archive lacks {', '.join(lacking)}.")
    return len(wrong)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line. Returns 0, or 1 if anything is missing or wrong."""
    parser = argparse.ArgumentParser(prog="fmu-all", description="Make one FMU for all platforms.")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "platforms", metavar="DIR")
    parser.add_argument("--native", type=Path, default=ROOT / "build", metavar="DIR", help="the native build")
    parser.add_argument("--sundials", type=Path, metavar="DIR", help="SUNDIALS' sources, 6.4 to 7.x")
    parser.add_argument(
        "--platform",
        action="append",
        choices=PLATFORMS,
        dest="platforms",
        help="make this platform alone; repeatable",
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N")
    options = parser.parse_args(arguments)
    try:
        build = Build(options.output.resolve(), options.native.resolve(), options.sundials, options.jobs)
        return min(build_all(build, options.platforms or PLATFORMS), 1)
    except (PlatformError, OSError, subprocess.CalledProcessError) as error:
        say(f"fmu-all: {error}")
        return 1


if __name__ == "__main__":
    sys.exit(main())
