"""Version of the installed package."""

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache  # every run tells it, and it is read from the distribution's files
def package_version() -> str:
    """Version of the distribution mixed-order-game, or "not installed" when run from the sources."""
    try:
        return version("mixed-order-game")
    except PackageNotFoundError:
        return "not installed"


__version__ = package_version()
