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
TAGS = {
    "linux64": "py3-none-manylinux_2_17_x86_64",
    "win64": "py3-none-win_amd64",
    "darwin64": "py3-none-macosx_11_0_universal2",
    "aarch64-linux": "py3-none-manylinux_2_17_aarch64",
}
"""Where a wheel can be installed: wherever one of its host tools runs."""

Settings = dict[str, Any]


def build_wheel(
    wheel_directory: str, config_settings: Settings | None = None, metadata_directory: str | None = None
) -> str:
    """Make a wheel (PEP 517)."""
    return scikit_build_core.build_wheel(wheel_directory, settings(config_settings), metadata_directory)


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Settings | None = None) -> str:
    """Make a wheel's metadata (PEP 517)."""
    return scikit_build_core.prepare_metadata_for_build_wheel(metadata_directory, settings(config_settings))


def settings(given: Settings | None) -> Settings:
    """Settings for scikit-build-core that name the libraries to take, or none, and the tags of the wheel."""
    folder = libraries()
    chosen = {f"cmake.define.{VARIABLE}": "" if folder is None else str(folder)}
    if folder is not None:
        tools = sorted(path.name for path in (folder / "tools").iterdir())
        chosen["wheel.tags"] = ";".join(TAGS[platform] for platform in tools)
    return {**(given or {}), **chosen}


def libraries() -> Path | None:
    """Folder of the libraries to take; None if this machine's own library is to be compiled.

    Raises SystemExit if the libraries in the folder were made from other sources than these.
    """
    root = Path.cwd()  # PEP 517
    chosen = os.environ.get(VARIABLE)
    folder = root / (chosen or "build/platforms")
    if not chosen and (chosen is not None or not (folder / "report.json").is_file()):
        return None
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    if report["sources"] != fingerprint(root):
        raise SystemExit(
            f"{folder} was made from other sources: run ./dev fmu-all again, "
            f"or set {VARIABLE} to nothing for a wheel of this machine's library alone"
        )
    return folder
