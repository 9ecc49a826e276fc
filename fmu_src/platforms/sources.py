"""Sources of what is compiled in: a folder of the user's, the upstream release, or Debian's copy of it."""

import hashlib
import os
import subprocess
import tarfile
import urllib.error
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from .targets import PlatformError

DEBIAN_SOURCES = (
    "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] "
    "http://deb.debian.org/debian bookworm main\n"
)
SECONDS_TO_CONNECT = 20


@dataclass(frozen=True)
class Release:
    """One version of a library, upstream and at Debian."""

    name: str
    version: str
    url: str
    sha256: str
    debian_package: str
    debian_file: str
    debian_sha256: str
    known_by: str
    """A file that its sources hold."""


SUNDIALS = Release(
    "sundials",
    "6.4.1",
    "https://github.com/LLNL/sundials/releases/download/v6.4.1/sundials-6.4.1.tar.gz",
    "7bf10a8d2920591af3fba2db92548e91ad60eb7241ab23350a9b1bc51e05e8d0",
    "sundials=6.4.1+dfsg1-3",
    "sundials_6.4.1+dfsg1.orig.tar.xz",
    "c61157f1d4be06c704bea40cb131eb63ba2dada161989071604d0a0959cdf04a",
    "src/cvode/cvode.c",
)
PUGIXML = Release(
    "pugixml",
    "1.13",
    "https://github.com/zeux/pugixml/releases/download/v1.13/pugixml-1.13.tar.gz",
    "40c0b3914ec131485640fa57e55bf1136446026b41db91c1bef678186a12abbe",
    "pugixml=1.13-0.2",
    "pugixml_1.13.orig.tar.gz",
    "5c5ad5d7caeb791420408042a7d88c2c6180781bf218feca259fd9d840a888e1",
    "src/pugixml.cpp",
)


def sources(release: Release, folder: Path, given: Path | None = None) -> tuple[Path, str]:
    """Folder of the sources, and words on where they come from.

    Downloads into `folder` on first use. Raises PlatformError if no way leads to them, or if a download is
    not what was expected: it is never replaced by another in that case.
    """
    if given is not None:
        if not (given / release.known_by).is_file():
            raise PlatformError(f"{given} is not {release.name}: {release.known_by} is missing")
        return given.resolve(), f"{release.name} from {given}"
    unpacked = folder / f"{release.name}-{release.version}"
    origin = folder / f"{release.name}-{release.version}.origin"
    if origin.is_file():
        return unpacked, origin.read_text(encoding="utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    try:
        archive = _upstream(release, folder)
        words = f"{release.name} {release.version} from {release.url}"
    except (urllib.error.URLError, TimeoutError) as reason:
        archive = _debian(release, folder, f"{release.url} cannot be reached ({reason})")
        words = f"{release.name} {release.version} from Debian's source package {release.debian_package}"
    with tarfile.open(archive) as tar:
        if hasattr(tarfile, "data_filter"):
            tar.extractall(folder, filter="data")
        else:  # early releases of Python 3.11; the archive is the one that the hash names
            tar.extractall(folder)  # noqa: S202
    if not (unpacked / release.known_by).is_file():
        raise PlatformError(f"{archive} does not hold {unpacked.name}/{release.known_by}")
    origin.write_text(words, encoding="utf-8")
    return unpacked, words


def _upstream(release: Release, folder: Path) -> Path:
    with urllib.request.urlopen(release.url, timeout=SECONDS_TO_CONNECT) as answer:  # noqa: S310 (https, constant)
        content = answer.read()
    return _checked(folder / Path(release.url).name, content, release.sha256)


def _debian(release: Release, folder: Path, reason: str) -> Path:
    """Debian's copy of the release, through apt with lists of its own: the system's stay as they are."""
    apt = folder / "apt"
    for name in ("lists/partial", "cache/archives/partial"):
        (apt / name).mkdir(parents=True, exist_ok=True)
    (apt / "sources.list").write_text(DEBIAN_SOURCES, encoding="utf-8")
    options = {
        "Dir::Etc::SourceList": apt / "sources.list",
        "Dir::Etc::SourceParts": os.devnull,
        "Dir::State::Lists": apt / "lists",
        "Dir::Cache": apt / "cache",
    }
    command = ["apt-get", "-q", *(f"-o{name}={value}" for name, value in options.items())]
    for task in (["update"], ["source", "--download-only", release.debian_package]):
        try:
            subprocess.run([*command, *task], cwd=folder, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            text = getattr(error, "stderr", None) or str(error)
            raise PlatformError(f"{reason}, and apt-get {task[0]} failed: {text.strip()}") from error
    archive = folder / release.debian_file
    return _checked(archive, archive.read_bytes(), release.debian_sha256)


def _checked(path: Path, content: bytes, sha256: str) -> Path:
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise PlatformError(f"{path.name} has the SHA-256 {found}, expected {sha256}")
    path.write_bytes(content)
    return path
