"""FMUs of games: reproducible, one binary for every game, and bad games refused in one sentence."""

import errno
import os
import shutil
import tempfile
import zipfile
from pathlib import Path

import pytest

from mixed_order_game import (
    BuildError,
    GameError,
    SimulationError,
    Simulator,
    build_fmu,
    cached_fmu,
    default_fmu,
    default_game,
    read_model,
)
from mixed_order_game.files.temporary import folder_of_process
from mixed_order_game.fmu import build
from tests.conftest import GAMES


def test_same_bytes_again(fmu: Path, tmp_path: Path) -> None:
    again = build_fmu(default_game(), tmp_path / "folder" / "again.fmu")
    assert again.read_bytes() == fmu.read_bytes()


def test_archive_carries_its_game_documentation_and_licenses(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        assert archive.read("resources/game.toml") == default_game().read_bytes()
    assert {"modelDescription.xml", "model.png", "documentation/index.html"} <= set(names)
    assert [name for name in names if name.startswith("binaries/")] == ["binaries/linux64/MixedOrderGame.so"]
    assert any(name.startswith("documentation/licenses/") for name in names)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("k3 = 50.0", "", "k3"),
        ("k3 = 50.0", "k3 = -50.0", "k3"),
        ("k3 = 50.0", "k3 = 50.0\nk9 = 1.0", "k9"),
        ("order = 1", "order = 3", "order"),
        ("W_max = 500.0", "W_max = 500.0 500.0", "line"),
        ("dimension = 2", "dimension = 1000000000", "dimension"),
    ],
)
def test_bad_games_are_refused_in_one_sentence(old: str, new: str, told: str, tmp_path: Path) -> None:
    text = default_game().read_text()
    assert old in text
    game = tmp_path / "bad.toml"
    game.write_text(text.replace(old, new, 1))
    with pytest.raises(GameError) as error:
        build_fmu(game, tmp_path / "out" / "bad.fmu")
    assert told in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_missing_game(tmp_path: Path) -> None:
    with pytest.raises(GameError, match="there is no game file"):
        build_fmu(tmp_path / "none.toml", tmp_path / "none.fmu")
    with pytest.raises(GameError, match="there is no game file"):
        cached_fmu(tmp_path / "none.toml")


def test_output_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BuildError, match="cannot write"):
        build_fmu(default_game(), tmp_path / "file" / "game.fmu")


def test_cache(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = default_fmu()
    assert first.is_relative_to(tmp_path)
    assert first.read_bytes() == fmu.read_bytes()
    monkeypatch.setattr(build, "_archive", None)
    assert default_fmu() == first
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cached_fmu(GAMES / "two_scalar_players.toml") != first


@pytest.mark.parametrize("damage", ["truncated", "changed", "empty", "folder"])
def test_a_damaged_entry_of_the_cache_is_made_again(
    damage: str, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    entry, content = default_fmu(), fmu.read_bytes()
    middle = len(content) // 2
    if damage == "folder":
        entry.unlink()
        (entry / "inside").mkdir(parents=True)
        elsewhere = default_fmu()
        assert elsewhere != entry
        entry = elsewhere
    else:
        damaged = {"truncated": content[:middle], "empty": b""}
        changed = content[:middle] + bytes(100) + content[middle + 100 :]
        entry.write_bytes(damaged.get(damage, changed))
        assert default_fmu() == entry
    assert entry.read_bytes() == content


def test_a_cache_that_cannot_be_written(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The FMU lies in a temporary folder as long as the process lives."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "cache"))
    made = default_fmu()
    assert made.is_relative_to(folder_of_process())
    assert made == default_fmu()
    assert made.read_bytes() == fmu.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(build, "write_fmu", no_space)
        assert default_fmu() == made
        with pytest.raises(
            BuildError, match=r"cannot make the FMU of .* is full; set the environment variable TMPDIR"
        ):
            cached_fmu(GAMES / "two_scalar_players.toml")


def no_space(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "is full; set the environment variable TMPDIR"),
        (
            Exception("Failed to load shared library"),
            "is mounted noexec, so that no library in it can be loaded",
        ),
        (OSError(errno.EACCES, "Permission denied", "/x"), "cannot be loaded: permission denied"),
    ],
)
def test_temporary_folders_that_are_of_no_use(
    error: Exception, told: str, fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("fmpy.extract", refuse)
    monkeypatch.setattr("mixed_order_game.files.temporary._runs_nothing", lambda _: True)
    with pytest.raises(SimulationError) as refused:
        Simulator(fmu)
    assert str(refused.value).startswith(f"{fmu} cannot be loaded: ")
    assert told in str(refused.value)


def test_no_place_for_temporary_files(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(
        SimulationError, match=r"no place for temporary files: .*; set the environment variable"
    ):
        Simulator(fmu)
    with pytest.raises(BuildError, match="no place for temporary files"):
        build_fmu(default_game(), tmp_path / "a.fmu")


@pytest.mark.parametrize("name", sorted(build.shipped_games()))
def test_games_of_the_package(name: str, tmp_path: Path) -> None:
    assert read_model(build_fmu(build.shipped_game(name), tmp_path / f"{name}.fmu")).title
    with pytest.raises(GameError, match=f"there is no game {name}s; did you mean {name}"):
        build.shipped_game(f"{name}s")


@pytest.fixture
def every_platform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installation with a library for each platform, and only this machine's host tool."""
    native = build.native_directory()
    package = tmp_path / "package"
    shutil.copytree(native, package / "_native")
    shutil.copytree(native.parent / "games", package / "games")
    for platform in ("win64", "darwin64", "aarch64-linux"):
        folder = package / "_native" / "binaries" / platform
        folder.mkdir()
        (folder / "MixedOrderGame.so").write_text(f"for {platform}")
    monkeypatch.setattr(build, "_package_folders", lambda: iter([package]))
    return package


def binaries(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {name.split("/")[1]: archive.read(name) for name in archive.namelist() if "binaries/" in name}


@pytest.mark.usefixtures("every_platform")
def test_every_library_of_the_package_is_packed(tmp_path: Path) -> None:
    packed = binaries(build_fmu(default_game(), tmp_path / "a.fmu"))
    assert set(packed) == {"linux64", "win64", "darwin64", "aarch64-linux"}


@pytest.mark.usefixtures("every_platform")
def test_arm_linux_has_its_library_in_both_folders(tmp_path: Path) -> None:
    arm = b"for aarch64-linux"
    packed = binaries(build_fmu(default_game(), tmp_path / "a.fmu", arm_linux=True))
    assert packed == {"aarch64-linux": arm, "linux64": arm}


def test_arm_linux_needs_its_library(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="has binaries for linux64, but none for aarch64-linux"):
        build_fmu(default_game(), tmp_path / "a.fmu", arm_linux=True)


@pytest.mark.parametrize(
    ("system", "machine", "platform"),
    [
        ("Linux", "x86_64", "linux64"),
        ("Linux", "aarch64", "aarch64-linux"),
        ("Windows", "AMD64", "win64"),
        ("Windows", "ARM64", "win64"),
        ("Darwin", "arm64", "darwin64"),
    ],
)
def test_each_machine_runs_its_own_tool(
    system: str, machine: str, platform: str, every_platform: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platform.system", lambda: system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    name = "mixed-order-game-description" + (".exe" if platform == "win64" else "")
    tool = every_platform / "_native" / "tools" / platform / name
    if platform != "linux64":
        with pytest.raises(BuildError, match=f"carries no host tool for {platform}"):
            build.host_tool()
        tool.parent.mkdir()
        tool.touch()
    assert build.host_tool() == tool


def test_installation_without_compiled_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    game = default_game()
    monkeypatch.setattr(build, "_package_folders", lambda: iter([tmp_path]))
    with pytest.raises(BuildError, match="carries no compiled FMU"):
        build_fmu(game, tmp_path / "a.fmu")
    with pytest.raises(BuildError, match="carries no games"):
        default_game()
