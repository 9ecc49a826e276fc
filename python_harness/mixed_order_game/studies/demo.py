"""The main job in one call: simulate the paper's example through fmpy, judge each claim, draw the figures."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..extras import has
from ..files.writing import CLAIMS, FIGURE, RESULT, check_output, write_file
from ..fmu.model import read_model
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
    force: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> Demo:
    """Judge every claim on an FMU and write, into the folder output, what was found.

    claims.json, robust.parquet and unperturbed.parquet (.csv where pyarrow is not installed) and the paper's
    figures (suffix .png, .pdf or .svg; none where matplotlib is not installed). They replace files of their
    kind, with force any; that is judged before any run. A run that ends early, or is not made for want of an
    equilibrium, leaves out its file and the figures.
    progress is called with what is being done and the part of it done, 0 to 1.
    Raises what validate, Result.save and save_figure raise.
    """
    output = Path(output)
    results = ".parquet" if has("pyarrow") else ".csv"
    kinds = {f"robust{results}": RESULT, f"unperturbed{results}": RESULT, "claims.json": CLAIMS}
    drawing = has("matplotlib")
    if drawing:
        from ..results.plot import paper_figure_names, paper_figures, save_figure

        kinds |= {f"{name}{suffix}": FIGURE for name in paper_figure_names(read_model(fmu))}
    for name, kind in kinds.items():
        check_output(output / name, kind, inputs=[Path(fmu)], force=force)
    validation = validate(fmu, progress=progress)
    claims = (json.dumps(validation.as_json(), indent=2) + "\n").encode()
    files = [write_file(output / "claims.json", CLAIMS, lambda file: file.write(claims), force=force)]
    robust, plain = validation.robust, validation.plain
    for run, name in ((robust, "robust"), (plain, "unperturbed")):
        if run is not None:
            files.append(run.save(output / f"{name}{results}", force=force))
    if drawing and robust is not None and plain is not None:
        figures = paper_figures(robust, plain)
        for number, (name, axes) in enumerate(figures.items(), start=1):
            files.append(save_figure(axes, output / f"{name}{suffix}", force=force))
            if progress is not None:
                progress("figures", number / len(figures))
    return Demo(validation, tuple(files))
