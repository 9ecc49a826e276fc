"""Python functions that a command line names by file and name, as in vehicle.py:plant."""

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from ..errors import ExperimentError, reason
from .reading import expect_file


def function_of_text(text: str) -> Callable[..., Any]:
    """The function that FILE:FUNCTION names; the file is run, its folder is looked in for what it imports.

    Raises ExperimentError for a file that cannot be run and a name that is no function in it.
    """
    file, _, name = text.rpartition(":")
    if not file or not name.isidentifier():
        raise ExperimentError(f"{text!r} is no function of a file, expected one such as vehicle.py:plant")
    path = Path(file).resolve()
    expect_file(path, "Python file", ExperimentError)
    spec = spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ExperimentError(f"{file} is no Python file (.py)")
    module = module_from_spec(spec)
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ExperimentError(f"{file} cannot be run: {type(error).__name__}: {reason(error)}") from error
    finally:
        sys.path.remove(str(path.parent))
    function = getattr(module, name, None)
    if not callable(function):
        known = sorted(key for key, value in vars(module).items() if callable(value) and key[0] != "_")
        has = f"it has {', '.join(known)}" if known else "it has none"
        raise ExperimentError(f"{file} has no function {name}: {has}")
    return function  # type: ignore[no-any-return]
