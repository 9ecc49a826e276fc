"""FMUs of games: reproducible, one binary for every game, and bad games refused in one sentence."""

import zipfile
from pathlib import Path

import pytest

from mixed_order_game import (
    BuildError,
    GameError,
    build,
    build_fmu,
    cached_fmu,
    default_fmu,
    default_game,
    read_model,
)
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
    monkeypatch.setattr(build, "build_fmu", None)
    assert default_fmu() == first
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cached_fmu(GAMES / "two_scalar_players.toml") != first


@pytest.mark.parametrize("name", sorted(build.shipped_games()))
def test_games_of_the_package(name: str, tmp_path: Path) -> None:
    assert read_model(build_fmu(build.shipped_game(name), tmp_path / f"{name}.fmu")).title
    with pytest.raises(GameError, match=f"there is no game {name}s; those that come with the package are"):
        build.shipped_game(f"{name}s")


def test_installation_without_compiled_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    game = default_game()
    monkeypatch.setattr(build, "_package_folders", lambda: iter([tmp_path]))
    with pytest.raises(BuildError, match="carries no compiled FMU"):
        build_fmu(game, tmp_path / "a.fmu")
    with pytest.raises(BuildError, match="carries no games"):
        default_game()
