"""Reproducible FMU archive: equal contents give equal bytes, and nothing half-made is left behind.

Standard library only, so that CMake can run the file by itself: `python packaging.py --help`.
"""

import argparse
import os
import re
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every entry: the earliest that a zip archive can hold."""

PERMISSIONS = 0o644
BINARY_PERMISSIONS = 0o755
COMPONENT = re.compile(r"[A-Za-z0-9_+-][A-Za-z0-9_.+-]*")


class PackagingError(Exception):
    """An archive that cannot be made; the text names the file or option and what was expected."""


def write_fmu(
    output: Path,
    *,
    model_description: Path,
    game: Path,
    binaries: Mapping[str, Path],
    documentation: Path | None = None,
    licenses: Mapping[str, Path] | None = None,
    icon: Path | None = None,
    extra: Path | None = None,
) -> Path:
    """Write the archive of one model and return its path.

    Archive member                        from
    modelDescription.xml                  model_description
    resources/game.toml                   game
    binaries/<platform>/<file name>       binaries, platform folder (linux64, win64, ...) to shared library
    documentation/...                     every file below the folder documentation
    documentation/licenses/<name>         licenses, name to file
    model.png                             icon
    extra/...                             every file below the folder extra

    Entries are sorted, dated 1980-01-01 and deflated. The file appears under its name only when complete.
    Raises PackagingError if a file is missing or two claim one entry, OSError if output cannot be written.
    """
    entries: dict[str, Path] = {}

    def add(member: str, source: Path) -> None:
        if not source.is_file():
            raise PackagingError(f"{member}: there is no file {source}")
        if member in entries:
            raise PackagingError(f"{member}: both {entries[member]} and {source} claim this entry")
        entries[member] = source

    if not binaries:
        raise PackagingError("an FMU needs at least one binary")
    add("modelDescription.xml", model_description)
    add("resources/game.toml", game)
    for platform, library in binaries.items():
        add(f"binaries/{_plain(platform)}/{library.name}", library)
    for folder, name in ((documentation, "documentation"), (extra, "extra")):
        for member, source in [] if folder is None else _tree(folder, name):
            add(f"{name}/{member}", source)
    for name, source in (licenses or {}).items():
        add(f"documentation/licenses/{_plain(name)}", source)
    if icon is not None:
        add("model.png", icon)

    write_archive(output, entries)
    return output


def _plain(name: str) -> str:
    """The name, if it can be one component of a path in the archive."""
    if not COMPONENT.fullmatch(name):
        raise PackagingError(f"{name!r} is not a plain name of letters, digits and . _ + -")
    return name


def _tree(folder: Path, name: str) -> Iterable[tuple[str, Path]]:
    """Files below a folder as (name relative to it with forward slashes, path); hidden files are left out."""
    if not folder.is_dir():
        raise PackagingError(f"{name}: there is no folder {folder}")
    for source in sorted(folder.rglob("*")):
        relative = source.relative_to(folder)
        if source.is_file() and not any(part.startswith(".") for part in relative.parts):
            yield relative.as_posix(), source


def write_archive(output: Path, entries: Mapping[str, Path]) -> None:
    """Write to a temporary file in the same folder, then rename: readers see the old file or the new one."""
    output.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{output.name}.", suffix=".part", dir=output.parent)
    temporary = Path(name)
    try:
        with (
            os.fdopen(handle, "wb") as file,
            zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
        ):
            for member in sorted(entries):
                archive.writestr(_entry(member), entries[member].read_bytes(), compresslevel=9)
        temporary.chmod(PERMISSIONS)
        temporary.replace(output)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _entry(member: str) -> zipfile.ZipInfo:
    """Header of an entry that depends on its name alone: no clock, no umask, no host system."""
    info = zipfile.ZipInfo(member, EPOCH)
    info.create_system = 3  # Unix, whatever the machine that packs
    permissions = BINARY_PERMISSIONS if member.startswith("binaries/") else PERMISSIONS
    info.external_attr = (0o100000 | permissions) << 16
    info.compress_type = zipfile.ZIP_DEFLATED
    return info


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line for CMake. Returns 0, or 1 after one sentence on stderr; wrong options exit with 2."""
    parser = argparse.ArgumentParser(prog="packaging", description="Pack a reproducible FMU archive.")
    parser.add_argument("--model-description", type=Path, required=True, metavar="XML")
    parser.add_argument(
        "--game", type=Path, required=True, metavar="TOML", help="becomes resources/game.toml"
    )
    parser.add_argument(
        "--binary",
        type=_named_path,
        action="append",
        required=True,
        metavar="PLATFORM=PATH",
        help="shared library for a platform folder, such as linux64=libs/MixedOrderGame.so; repeatable",
    )
    parser.add_argument("--documentation", type=Path, metavar="DIR")
    parser.add_argument(
        "--license",
        type=_named_path,
        action="append",
        default=[],
        metavar="NAME=PATH",
        help="becomes documentation/licenses/NAME; repeatable",
    )
    parser.add_argument("--licenses", type=Path, metavar="DIR", help="every file in it, by its own name")
    parser.add_argument("--icon", type=Path, metavar="PNG", help="becomes model.png")
    parser.add_argument("--extra", type=Path, metavar="DIR", help="becomes extra/")
    parser.add_argument("--output", type=Path, required=True, metavar="FMU")
    options = parser.parse_args(arguments)
    try:
        write_fmu(
            options.output,
            model_description=options.model_description,
            game=options.game,
            binaries=_unique(options.binary, "--binary"),
            documentation=options.documentation,
            licenses=_unique([*options.license, *_files(options.licenses)], "--license"),
            icon=options.icon,
            extra=options.extra,
        )
    except (PackagingError, OSError) as error:
        print(f"packaging: {error}", file=sys.stderr)
        return 1
    return 0


def _named_path(text: str) -> tuple[str, Path]:
    name, separator, path = text.partition("=")
    if not (name and separator and path):
        raise argparse.ArgumentTypeError(f"NAME=PATH expected, not {text!r}")
    return name, Path(path)


def _files(folder: Path | None) -> list[tuple[str, Path]]:
    """Names and paths of the files in a folder; none if no folder is given."""
    return (
        [] if folder is None else [(path.name, path) for path in sorted(folder.iterdir()) if path.is_file()]
    )


def _unique(pairs: Sequence[tuple[str, Path]], option: str) -> dict[str, Path]:
    named = dict(pairs)
    if len(named) != len(pairs):
        raise PackagingError(f"{option}: a name is given twice")
    return named


if __name__ == "__main__":
    sys.exit(main())
