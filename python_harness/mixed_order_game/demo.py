"""The main job in one call: simulate the paper's example through fmpy, judge each claim, draw the figures."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .errors import ResultError
from .plot import paper_figures, save_figure
from .results import write_whole
from .validate import Validation, validate


@dataclass(frozen=True, eq=False)
class Demo:
    """What the demo found and the files it wrote."""

    validation: Validation
    files: tuple[Path, ...]


def demo(
    fmu: Path | str,
    output: Path | str,
    *,
    suffix: str = ".png",
    progress: Callable[[str, float], None] | None = None,
) -> Demo:
    """Judge every claim on an FMU and write, into the folder output, what was found.

    claims.json, robust.parquet, unperturbed.parquet and the paper's figures (suffix .png, .pdf or .svg).
    progress is called with what is being done and the part of it done, 0 to 1.
    Raises what validate, Result.save and save_figure raise.
    """
    output = Path(output)
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot write into {output}: {error}") from error
    validation = validate(fmu, progress=progress)
    files = [
        validation.robust.save(output / "robust.parquet"),
        validation.plain.save(output / "unperturbed.parquet"),
        output / "claims.json",
    ]
    claims = json.dumps(validation.as_json(), indent=2) + "\n"
    write_whole(files[-1], lambda file: file.write(claims.encode()))
    figures = paper_figures(validation.robust, validation.plain)
    for number, (name, axes) in enumerate(figures.items(), start=1):
        files.append(save_figure(axes, output / f"{name}{suffix}"))
        if progress is not None:
            progress("figures", number / len(figures))
    return Demo(validation, tuple(files))
