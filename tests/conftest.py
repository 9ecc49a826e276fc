"""Fixtures of the Python package's tests: FMUs of the paper's example and of the test games."""

import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from mixed_order_game import build_fmu, default_game

# under nohup or in the background some are ignored, and commands would ignore them, too
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

GAMES = Path(__file__).parent / "reference" / "games"
COEFFICIENT_GAMES = [
    path for path in sorted(GAMES.glob("*.toml")) if "expression" not in path.read_text(encoding="utf-8")
]
"""What the oracle reads."""

FmuOf = Callable[[str], Path]


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of the paper's example."""
    return build_fmu(default_game(), tmp_path_factory.mktemp("fmu") / "MixedOrderGame.fmu")


@pytest.fixture(scope="session")
def fmu_of(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> FmuOf:
    """The FMU of a game in tests/reference/games by name, or of the paper's example, built once."""
    built = {"five_vehicles": fmu}
    folder = tmp_path_factory.mktemp("fmus")

    def build(name: str) -> Path:
        if name not in built:
            built[name] = build_fmu(GAMES / f"{name}.toml", folder / f"{name}.fmu")
        return built[name]

    return build
