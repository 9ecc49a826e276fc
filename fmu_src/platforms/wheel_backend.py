"""The build backend: scikit-build-core, and the libraries of all platforms when they have been made.

MIXED_ORDER_GAME_PLATFORMS names their folder; an empty value asks for a wheel of this machine's own library.
Without it the folder is build/platforms, if `./dev fmu-all` has left anything there.
"""

import json
import os
from pathlib import Path
from typing import Any

from fingerprint import fingerprint  # a neighbour: the build backend's folder is on the path
from scikit_build_core import build as scikit_build_core
from scikit_build_core.build import (
    build_editable,
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
    get_requires_for_build_wheel,
    prepare_metadata_for_build_editable,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

VARIABLE = "MIXED_ORDER_GAME_PLATFORMS"

Settings = dict[str, Any] | None


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Make a wheel (PEP 517)."""
    choose_libraries()
    return scikit_build_core.build_wheel(wheel_directory, config_settings, metadata_directory)


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Settings = None) -> str:
    """Make a wheel's metadata (PEP 517)."""
    choose_libraries()
    return scikit_build_core.prepare_metadata_for_build_wheel(metadata_directory, config_settings)


def choose_libraries() -> None:
    """Let the variable name the folder to take, or leave it empty.

    Raises SystemExit if the libraries in the folder were made from other sources than these.
    """
    root = Path.cwd()
    chosen = os.environ.get(VARIABLE)
    folder = root / (chosen or "build/platforms")
    if not chosen and (chosen is not None or not (folder / "report.json").is_file()):
        return
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    if report["sources"] != fingerprint(root):
        raise SystemExit(
            f"{folder} was made from other sources: run ./dev fmu-all again, "
            f"or set {VARIABLE} to nothing for a wheel of this machine's library alone"
        )
    os.environ[VARIABLE] = str(folder)
