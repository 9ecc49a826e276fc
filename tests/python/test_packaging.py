"""The archive: reproducible bytes, the members expected, and nothing half-made left behind."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from mixed_order_game.fmu import packaging
from mixed_order_game.fmu.packaging import PackagingError, main, write_fmu

MEMBERS = [
    "binaries/linux64/MixedOrderGame.so",
    "binaries/win64/MixedOrderGame.dll",
    "documentation/figures/graph.svg",
    "documentation/index.html",
    "documentation/licenses/sundials.txt",
    "model.png",
    "modelDescription.xml",
    "resources/game.toml",
]


@pytest.fixture
def parts(tmp_path: Path) -> Path:
    folder = tmp_path / "parts"
    (folder / "documentation" / "figures").mkdir(parents=True)
    (folder / "documentation" / ".hidden").write_text("x")
    (folder / "documentation" / "index.html").write_text("<html></html>")
    (folder / "documentation" / "figures" / "graph.svg").write_text("<svg/>")
    for name in ("modelDescription.xml", "my game.toml", "MixedOrderGame.so", "MixedOrderGame.dll"):
        (folder / name).write_text(name * 100)
    (folder / "license").write_text("BSD")
    (folder / "icon.png").write_bytes(b"PNG")
    return folder


def arguments(parts: Path, output: Path) -> list[str]:
    return [
        *("--model-description", str(parts / "modelDescription.xml")),
        *("--game", str(parts / "my game.toml")),
        *("--binary", f"linux64={parts / 'MixedOrderGame.so'}"),
        *("--binary", f"win64={parts / 'MixedOrderGame.dll'}"),
        *("--documentation", str(parts / "documentation")),
        *("--license", f"sundials.txt={parts / 'license'}"),
        *("--icon", str(parts / "icon.png")),
        *("--output", str(output)),
    ]


def small(parts: Path, output: Path) -> Path:
    return write_fmu(
        output,
        model_description=parts / "modelDescription.xml",
        game=parts / "my game.toml",
        binaries={"linux64": parts / "MixedOrderGame.so"},
    )


def test_members_sorted_deflated_and_dated_alike(parts: Path, tmp_path: Path) -> None:
    assert main(arguments(parts, tmp_path / "a.fmu")) == 0
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        assert archive.testzip() is None
        assert archive.namelist() == MEMBERS
        entries = archive.infolist()
        assert archive.read("resources/game.toml") == (parts / "my game.toml").read_bytes()
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}
    assert {entry.compress_type for entry in entries} == {zipfile.ZIP_DEFLATED}
    assert {entry.create_system for entry in entries} == {3}
    modes = {entry.filename: entry.external_attr >> 16 & 0o777 for entry in entries}
    assert modes["binaries/linux64/MixedOrderGame.so"] == 0o755
    assert modes["modelDescription.xml"] == 0o644


def test_same_bytes_whenever_and_wherever(parts: Path, tmp_path: Path) -> None:
    main(arguments(parts, tmp_path / "a.fmu"))
    before = os.umask(0o077)
    try:
        for file in parts.rglob("*"):
            os.utime(file, (1e9, 1e9))
        moved = parts.rename(tmp_path / "moved")
        shuffled = arguments(moved, tmp_path / "b.fmu")
        main([*shuffled[6:], *shuffled[:6]])
    finally:
        os.umask(before)
    assert (tmp_path / "a.fmu").read_bytes() == (tmp_path / "b.fmu").read_bytes()
    assert (tmp_path / "b.fmu").stat().st_mode & 0o777 == 0o644


def test_folder_of_licenses(parts: Path, tmp_path: Path) -> None:
    licenses = tmp_path / "licenses"
    licenses.mkdir()
    (licenses / "libstdc++.txt").write_text("GPL with exception")
    assert main([*arguments(parts, tmp_path / "a.fmu"), "--licenses", str(licenses)]) == 0
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        assert archive.read("documentation/licenses/libstdc++.txt") == b"GPL with exception"


def test_failure_keeps_the_old_file_and_leaves_nothing(
    parts: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output = tmp_path / "out" / "a.fmu"
    output.parent.mkdir()
    output.write_text("old")

    def fail(*_: object) -> None:
        raise OSError("the disk is full")

    monkeypatch.setattr(packaging, "_entry", fail)
    with pytest.raises(OSError, match="disk is full"):
        small(parts, output)
    assert [path.name for path in output.parent.iterdir()] == ["a.fmu"]
    assert output.read_text() == "old"


def test_missing_file_is_named_before_anything_is_written(
    parts: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (parts / "MixedOrderGame.so").unlink()
    assert main(arguments(parts, tmp_path / "out" / "a.fmu")) == 1
    told = capsys.readouterr().err
    assert told.startswith("packaging: binaries/linux64/MixedOrderGame.so: there is no file")
    assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("platform", ["../linux64", "a/b", "", "..", "/linux64"])
def test_platform_must_be_a_plain_name(platform: str, parts: Path, tmp_path: Path) -> None:
    with pytest.raises(PackagingError, match="plain name"):
        write_fmu(
            tmp_path / "a.fmu",
            model_description=parts / "modelDescription.xml",
            game=parts / "my game.toml",
            binaries={platform: parts / "MixedOrderGame.so"},
        )


def test_two_files_for_one_entry(parts: Path, tmp_path: Path) -> None:
    (parts / "documentation" / "licenses").mkdir()
    (parts / "documentation" / "licenses" / "sundials.txt").write_text("x")
    assert main(arguments(parts, tmp_path / "a.fmu")) == 1
    assert not (tmp_path / "a.fmu").exists()


def test_runs_by_itself_without_any_package(parts: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-I", "-S", packaging.__file__, *arguments(parts, tmp_path / "a.fmu")]
    assert subprocess.run(command, check=False).returncode == 0
    assert (tmp_path / "a.fmu").is_file()


@pytest.mark.parametrize("extra", [["--binary", "linux64"], ["--nonsense"]])
def test_wrong_usage_exits_with_2(extra: list[str], parts: Path, tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*arguments(parts, tmp_path / "a.fmu"), *extra])
    assert ended.value.code == 2
    assert not (tmp_path / "a.fmu").exists()
