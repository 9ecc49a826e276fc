"""Version of the installed package, read when it is asked for: what reads it takes long to import."""

from functools import cache

__version__: str


@cache  # every run tells it, and it is read from the distribution's files
def package_version() -> str:
    """Version of the distribution mixed-order-game, or "not installed" when run from the sources."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("mixed-order-game")
    except PackageNotFoundError:
        return "not installed"


def __getattr__(name: str) -> str:
    if name == "__version__":
        return package_version()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
