"""The FMU for all platforms: what its libraries export and need, and whether they compute the same.

Most tests look at what `./dev fmu-all` has made, in build/platforms or where the variable
MIXED_ORDER_GAME_PLATFORMS points.
"""

import io
import os
import shutil
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fmu_src.platforms import binary_table, build_all, exercise, mach_o, sources
from fmu_src.platforms.targets import TARGETS, PlatformError, Target

ROOT = Path(__file__).resolve().parents[2]
CHOSEN = os.environ.get("MIXED_ORDER_GAME_PLATFORMS")
FOLDER = Path(CHOSEN) if CHOSEN else ROOT / "build" / "platforms"

PERMITTED = 1e-4
"""Largest difference of an action between platforms: a few times the error of a run at the default tolerance.

The C libraries' functions pow, by which CVODE chooses its steps, differ in a last digit now and then."""


built = pytest.mark.skipif(
    CHOSEN is None and not (FOLDER / "report.json").is_file(), reason="./dev fmu-all has not been run"
)
each_platform = pytest.mark.parametrize("platform", build_all.PLATFORMS)


def made() -> list[str]:
    """The platforms that were asked for and could be made."""
    return [platform for platform in build_all.PLATFORMS if (FOLDER / "binaries" / platform).is_dir()]


def library(platform: str) -> Path:
    if platform not in made():
        pytest.skip(f"./dev fmu-all has not made {platform}")
    (path,) = (FOLDER / "binaries" / platform).iterdir()
    return path


@pytest.fixture(scope="module")
def description(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("description")
    with zipfile.ZipFile(FOLDER / build_all.ARCHIVE) as archive:
        return Path(archive.extract("modelDescription.xml", folder))


@pytest.fixture(scope="module")
def reference(description: Path) -> exercise.Run:
    return run("linux64", description)


def run(platform: str, description: Path, game: Path = build_all.GAME) -> exercise.Run:
    host = FOLDER / platform / ("host.exe" if platform == "win64" else "host")
    return exercise.exercise(platform, host, library(platform), description, game)


EXPRESSION_GAMES = ("energy_peak_price", "switching_cooling")
"""With erf, sqrt, sinh and cos; with square waves and noise."""


@pytest.fixture(scope="module", params=EXPRESSION_GAMES)
def general(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A game with expressions, and its description by the native host tool."""
    game = build_all.GAME.with_name(f"{request.param}.toml")
    output = tmp_path_factory.mktemp("general") / "modelDescription.xml"
    tool = FOLDER / "tools" / "linux64" / build_all.TOOL
    subprocess.run([tool, "--output", output, game], check=True)
    return game, output


@pytest.fixture(scope="module")
def general_reference(general: tuple[Path, Path]) -> exercise.Run:
    game, output = general
    return run("linux64", output, game)


# the archives


@built
def test_the_archive_holds_one_library_for_each_platform() -> None:
    with zipfile.ZipFile(FOLDER / build_all.ARCHIVE) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/")]
        assert sorted(names) == sorted(f"binaries/{platform}/{library(platform).name}" for platform in made())
        for name in names:
            assert archive.read(name) == (FOLDER / name).read_bytes()


@built
def test_the_second_archive_has_the_arm_library_in_linux64() -> None:
    with zipfile.ZipFile(FOLDER / build_all.ARM_ARCHIVE) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/")]
        assert names == [f"binaries/{folder}/MixedOrderGame.so" for folder in ("aarch64-linux", "linux64")]
        for name in names:
            assert archive.read(name) == library("aarch64-linux").read_bytes()


@built
@pytest.mark.parametrize("archive", [build_all.ARCHIVE, build_all.ARM_ARCHIVE])
def test_licences_of_everything_linked_in_are_packed(archive: str) -> None:
    expected = {"mixed-order-game", "sundials", *build_all.HEADERS_ONLY, *build_all.LICENSES}
    with zipfile.ZipFile(FOLDER / archive) as packed:
        for name in expected:
            assert len(packed.read(f"documentation/licenses/{name}.txt")) > 500, name


@built
def test_the_checker_of_fmpy_finds_nothing() -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(FOLDER / build_all.ARCHIVE)) == []
    assert validate_fmu(str(FOLDER / build_all.ARM_ARCHIVE)) == []


@built
def test_libcosim_runs_the_archive() -> None:
    from tests.python import test_second_importer

    test_second_importer.test_libcosim_agrees_with_fmpy(FOLDER / build_all.ARCHIVE)


# the libraries


@built
@each_platform
def test_a_library_exports_the_standard_and_needs_the_system_alone(
    platform: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fmpy import __file__ as fmpy_file

    monkeypatch.setattr(sys, "path", [*sys.path, str(FOLDER / "packages")])
    functions = binary_table.functions_of_the_standard(Path(fmpy_file).parent / "c-code")
    images = list(binary_table.images(platform, library(platform)))
    assert {image.processor for image in images} == binary_table.PROCESSORS[platform]
    assert [text for image in images for text in binary_table.complaints(image, functions)] == []


@built
@each_platform
def test_a_library_computes_what_linux64_computes(
    platform: str, description: Path, reference: exercise.Run
) -> None:
    try:
        exercise.launcher(platform)
    except PlatformError as reason:
        pytest.skip(f"built, not run: {reason}")
    result = run(platform, description)
    assert result.restored
    assert result.deserialized
    assert len(result.times) == 201
    assert exercise.compare(result, reference).largest <= PERMITTED


@built
@each_platform
def test_a_library_computes_games_with_expressions_as_linux64_does(
    platform: str, general: tuple[Path, Path], general_reference: exercise.Run
) -> None:
    try:
        exercise.launcher(platform)
    except PlatformError as reason:
        pytest.skip(f"built, not run: {reason}")
    game, output = general
    result = run(platform, output, game)
    assert result.restored
    assert result.deserialized
    assert len(result.times) == 201
    assert exercise.compare(result, general_reference).largest <= PERMITTED


@built
@each_platform
def test_a_host_tool_describes_the_game_as_the_native_one_does(
    platform: str, description: Path, tmp_path: Path
) -> None:
    library(platform)
    tool = FOLDER / "tools" / platform / (build_all.TOOL + (".exe" if platform == "win64" else ""))
    folder = tmp_path / exercise.FOLDER
    folder.mkdir()
    game = shutil.copy(build_all.GAME, folder)
    output = folder / "modelDescription.xml"
    options = ("--output", exercise.path_there(platform, output))
    try:
        done = exercise.run_there(
            platform,
            tool,
            *options,
            exercise.path_there(platform, Path(game)),
            wine_prefix=FOLDER / "win64" / "wine",
        )
    except PlatformError as reason:
        pytest.skip(f"built, not run: {reason}")
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    assert output.read_bytes() == description.read_bytes()


@built
def test_a_platform_that_fails_is_named_and_the_rest_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(FOLDER / "packages")])

    class WithoutWindows(build_all.Build):
        def __init__(self) -> None:
            self.folder = tmp_path
            self.description = tmp_path / "modelDescription.xml"
            with zipfile.ZipFile(FOLDER / build_all.ARCHIVE) as archive:
                parts = ("modelDescription.xml", "extra/")
                archive.extractall(tmp_path, [n for n in archive.namelist() if n.startswith(parts)])
            for target in TARGETS:
                if target.platform in made():
                    (tmp_path / target.name).symlink_to(FOLDER / target.name)
            from fmpy import __file__ as fmpy_file

            self.headers = Path(fmpy_file).parent / "c-code"

        def compile(self, target: Target) -> None:
            if target.platform == "win64":
                raise PlatformError("win64 could not be compiled")

        def collect_licenses(self) -> Path:
            return FOLDER / "licenses"

    monkeypatch.setattr(exercise, "launcher", lambda _: _nothing_runs())
    assert build_all.build_all(WithoutWindows(), [*made(), "win64"]) == 1
    assert "lacks win64" in capsys.readouterr().err
    with zipfile.ZipFile(tmp_path / build_all.ARCHIVE) as archive:
        platforms = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert platforms == set(made()) - {"win64"}


def _nothing_runs() -> tuple[list[str], str]:
    raise PlatformError("nothing runs in this test")


# the parts of the build, which need no build


def test_exports_are_filtered_and_found_again() -> None:
    names = {
        f"_fmi2{name}": bytes([k]) for k, name in enumerate(["GetReal", "GetRealStatus", "Get", "Reset"])
    }
    assert mach_o._read_trie(mach_o._trie(names)) == names


@built
def test_pages_are_hashed_as_the_linker_does() -> None:
    """The linker's own signature comes out again, so the one after the change of exports is right too."""
    library("darwin64")
    image = (FOLDER / "darwin64-arm64" / "fmu_src" / "MixedOrderGame.dylib").read_bytes()
    again = bytearray(image)
    at = 32
    while struct.unpack_from("<I", image, at)[0] != mach_o.LC_CODE_SIGNATURE:
        at += struct.unpack_from("<I", image, at + 4)[0]
    mach_o._sign_again(again, struct.unpack_from("<I", image, at + 8)[0])
    assert bytes(again) == image
    again[100000] ^= 1
    mach_o._sign_again(again, struct.unpack_from("<I", image, at + 8)[0])
    assert sum(a != b for a, b in zip(again, image, strict=True)) > 20


def test_a_universal_library_holds_its_slices_on_whole_pages() -> None:
    slices = [struct.pack("<3I", mach_o.MAGIC, processor, 0) + bytes(5000) for processor in (7, 12)]
    whole = mach_o.universal(slices)
    assert struct.unpack_from(">2I", whole) == (0xCAFEBABE, 2)
    for k, image in enumerate(slices):
        processor, _, offset, size, _ = struct.unpack_from(">5I", whole, 8 + 20 * k)
        assert processor == struct.unpack_from("<I", image, 4)[0]
        assert offset % 2**14 == 0
        assert whole[offset : offset + size] == image


def test_a_download_that_is_not_the_expected_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urllib.request.urlopen", lambda *_args, **_options: io.BytesIO(b"another"))
    monkeypatch.setattr(subprocess, "run", None)  # and no other way is tried
    with pytest.raises(PlatformError, match="SHA-256"):
        sources.sources(sources.SUNDIALS, tmp_path)


def test_a_given_folder_must_hold_the_sources(tmp_path: Path) -> None:
    with pytest.raises(PlatformError, match=r"cvode\.c is missing"):
        sources.sources(sources.SUNDIALS, tmp_path / "sources", tmp_path)
    for release in (sources.SUNDIALS, sources.PUGIXML):
        path = tmp_path / release.known_by
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
        assert sources.sources(release, tmp_path / "sources", tmp_path)[0] == tmp_path.resolve()


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({}, ""),
        ({"exports": ("fmi2Reset", "CVode")}, "exports CVode"),
        ({"exports": ()}, "does not export fmi2Reset"),
        ({"libraries": ("libstdc++.so.6",)}, "needs libstdc++.so.6"),
        ({"baseline": (2, 34)}, "needs glibc 2.34, expected at most glibc 2.17"),
        ({"processor": "arm64"}, "is for arm64"),
    ],
)
def test_complaints(change: dict[str, object], complaint: str) -> None:
    image = {
        "platform": "linux64",
        "processor": "x86_64",
        "exports": ("fmi2Reset",),
        "libraries": ("libc.so.6", "libm.so.6"),
        "system": "glibc",
        "baseline": (2, 16),
        "signed": None,
        "size": 1,
    }
    found = binary_table.complaints(binary_table.Image(**(image | change)), {"fmi2Reset"})  # type: ignore[arg-type]
    if complaint:
        assert len(found) == 1
        assert complaint in found[0]
    else:
        assert found == []


def test_runs_are_compared_number_by_number() -> None:
    first = exercise.Run((0.0, 0.1), ((1.0, 2.0), (3.0, 4.0)), "after 7 steps", True, True, None)
    other = exercise.Run((0.0, 0.1), ((1.0, 2.0), (3.0, 4.5)), "after 8 steps", True, True, None)
    assert exercise.compare(first, first) == exercise.Difference(True, 0.0, None)
    assert exercise.compare(other, first) == exercise.Difference(False, 0.5, 0.1)
