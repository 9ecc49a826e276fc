"""Fingerprint of what is compiled into the libraries, so that no wheel carries those of other sources."""

import hashlib
from pathlib import Path

FOLDERS = ("core", "fmu_src", "modelDescription")
SUFFIXES = {".cpp", ".hpp", ".ipp", ".map", ".txt"}


def fingerprint(root: Path) -> str:
    """SHA-256 over names and contents of the sources below the project's folder."""
    digest = hashlib.sha256()
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SUFFIXES:
                digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
