"""Packages that only some commands need: each comes with an extra of this package."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from .errors import MissingPackageError

EXTRAS = {
    "bokeh": "app",
    "distributed": "dask",
    "jinja2": "report",
    "jsonschema": "check",
    "latex2mathml": "report",
    "matplotlib": "plot",
    "pandas": "tables",
    "plotly": "report",
    "pyarrow": "parquet",
    "sympy": "symbols",
    "tornado": "app",
    "xarray": "tables",
}


def need(module: str) -> Any:
    """A module of a package that an extra brings. Raises MissingPackageError, which names the extra."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        package = module.partition(".")[0]
        raise MissingPackageError(f"this needs {package}: {install(package)}") from error


def has(package: str) -> bool:
    """Whether a package of an extra is installed."""
    return find_spec(package) is not None


def install(package: str) -> str:
    """How to install a package of an extra."""
    return f'pip install "mixed-order-game[{EXTRAS[package]}]"'
