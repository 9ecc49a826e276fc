"""Expressions of SymPy as texts of the game files' language."""

import math
from collections.abc import Callable
from typing import Any

from ..errors import GameError
from ..extras import need

FUNCTIONS = ("exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "erf")
"""Functions of the language that SymPy calls by the same name."""


def text_of(function: Callable[..., Any]) -> str:
    """What a function of x returns, as text: x[i, l] counts from 1. Raises MissingPackageError, GameError."""
    sympy = need("sympy")
    expression = sympy.sympify(function(sympy.IndexedBase("x")))
    unknown = {each.func.__name__ for each in expression.atoms(sympy.Function)} - set(FUNCTIONS)
    if unknown:
        known = ", ".join(FUNCTIONS)
        raise GameError(f"the function {min(unknown)} has no text here, expected one of {known}")
    plain = expression.xreplace({sympy.E: sympy.Float(math.e, 17)})
    return str(sympy.sstr(plain, full_prec=True)).replace("**", "^")
