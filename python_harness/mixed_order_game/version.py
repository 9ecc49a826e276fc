"""Version of the installed package."""

from importlib.metadata import PackageNotFoundError, version


def package_version() -> str:
    """Version of the distribution mixed-order-game, or "not installed" when run from the sources."""
    try:
        return version("mixed-order-game")
    except PackageNotFoundError:
        return "not installed"


__version__ = package_version()
