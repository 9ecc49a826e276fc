"""The claim that the FMU's model description is valid."""

import re
from pathlib import Path

from .verdict import Claim, Verdict

NAME = re.compile(r"(der\()?[A-Za-z_]\w*(\[\d+(,\d+)*\])?(?(1)\))")
"""Structured names of FMI 2.0 that FMUs of this project have. fmpy's own parser takes 2 ms a name."""


def archive_valid(path: Path) -> Claim:
    """What fmpy finds: schema, unique names, structure, start values, causalities, units."""
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    problems: list[str] = []
    try:
        description = read_model_description(str(path), validate=True, validate_model_structure=True)
        names = (variable.name for variable in description.modelVariables)
        problems = [f"{name} is not a structured name" for name in names if not NAME.fullmatch(name)]
    except ValidationError as error:
        problems = list(error.problems)
    verdict = Verdict.FAILS if problems else Verdict.HOLDS
    reason = "fmpy finds no problem in it."
    if problems:
        reason = f"Problems: {len(problems)}, the first: {problems[0]}"
    figures = {"problems": float(len(problems))}
    return Claim("archive", "The model description is valid", verdict, reason, figures)
