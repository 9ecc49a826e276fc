"""What an analysis hands over: rows of figures, hypotheses, demonstrations and verdicts in plain words."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..game.bounds import GameBounds
from ..notebook import digits, folded, listed, page, table
from .constants import LoopConstants
from .design import Design
from .exact_loop import ExactLoop
from .game import finite_or_none
from .hypotheses import Hypothesis
from .simulation import Seen

Figure = float | bool | str

Progress = Callable[[str, float], None]
"""Called with the name of a step and the part of it done, 0 to 1."""


@dataclass(frozen=True)
class Row:
    """One figure. section groups rows; unit "1" where there is none, L for the game's length unit."""

    section: str
    name: str
    value: Figure
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One design with its hypotheses and the run that shows it; seen is None if it was not run."""

    name: str
    design: Design
    hypotheses: tuple[Hypothesis, ...]
    seen: Seen | None
    failure: str  # why there is no run

    @property
    def complete(self) -> bool:
        """Whether every hypothesis holds."""
        return all(hypothesis.holds for hypothesis in self.hypotheses)

    @property
    def seen_radius(self) -> float:
        """Largest |x - x*| seen after the guarantee's settling time; NaN without a run."""
        return math.nan if self.seen is None else self.seen.radius(self.design.settling_time)


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """Everything that `mog analyse` tells."""

    title: str
    path: Path
    rows: tuple[Row, ...]
    hypotheses: tuple[Hypothesis, ...]  # of Theorem 1, for the game's own gains
    demonstrations: tuple[Demonstration, ...]
    verdicts: tuple[str, ...]
    constants: LoopConstants | None  # None for games with expressions
    exact: ExactLoop | None  # None for games too large for the dense loop, or with expressions
    runs: Mapping[str, Seen]  # "robust" and "plain", with the game's own gains
    bounds: GameBounds | None = None  # of games with expressions

    def __repr__(self) -> str:
        return f"<Analysis {self.title}: {len(self.verdicts)} verdicts>"

    def _repr_html_(self) -> str:
        """For notebooks: the verdicts, and folded every figure and hypothesis."""
        figures = [
            (
                row.section,
                row.name,
                row.value if isinstance(row.value, str) else digits(row.value),
                "" if row.unit == "1" else row.unit,
                row.meaning,
            )
            for row in self.rows
        ]
        parts = [folded("Figures", table(["section", "figure", "value", "unit", "meaning"], figures))]
        if self.hypotheses:
            words = {True: "holds", False: "fails", None: "open"}
            judged = [(words[each.holds], each.name, each.figures) for each in self.hypotheses]
            told = table(["", "hypothesis", "figures"], judged)
            parts.append(folded("Hypotheses of Theorem 1 for the given gains", told))
        return page(self.title, listed(self.verdicts), *parts)

    def value(self, section: str, name: str) -> Figure:
        """The figure of one row. Raises KeyError."""
        for row in self.rows:
            if (row.section, row.name) == (section, name):
                return row.value
        raise KeyError(f"{section}: {name}")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for json.dumps; what is not finite becomes None."""

        def plain(entry: Mapping[str, Any]) -> dict[str, Any]:
            return {key: finite_or_none(value) for key, value in entry.items()}

        c = self.constants
        return {
            "title": self.title,
            "game": str(self.path),
            "constants": None
            if c is None
            else {
                "monotonicity": c.monotonicity,
                "lipschitz": c.lipschitz.tolist(),
                "hessian_norm": c.hessian_norm,
                "b": c.paper_b,
                "consensus_eigenvalues": c.eigenvalues.tolist(),
            },
            "box": None if self.bounds is None else _box(self.bounds),
            "rows": [plain(asdict(row)) for row in self.rows],
            "hypotheses": [plain(asdict(hypothesis)) for hypothesis in self.hypotheses],
            "demonstrations": [
                {
                    "name": each.name,
                    "gains": plain(vars(each.design.gains)),
                    "weights": plain(vars(each.design.certificate.weights)),
                    "rate": finite_or_none(each.design.certificate.rate),
                    "set": plain(asdict(each.design.domain)),
                    "guaranteed_radius": finite_or_none(each.design.radius),
                    "guaranteed_settling_time": finite_or_none(each.design.settling_time),
                    "seen_radius": finite_or_none(each.seen_radius),
                    "hypotheses": [plain(asdict(hypothesis)) for hypothesis in each.hypotheses],
                    "failure": each.failure,
                }
                for each in self.demonstrations
            ],
            "verdicts": list(self.verdicts),
        }


def _box(bounds: GameBounds) -> dict[str, Any]:
    def numbers(values: Any) -> Any:
        return [numbers(each) for each in values] if isinstance(values, list) else finite_or_none(values)

    return {
        "lower": bounds.box.lower.tolist(),
        "upper": bounds.box.upper.tolist(),
        "monotonicity": finite_or_none(bounds.monotonicity),
        "sampled_monotonicity": finite_or_none(bounds.sampled_monotonicity),
        "lipschitz": numbers(bounds.gradients.lipschitz.tolist()),
        "sampled_lipschitz": numbers(bounds.gradients.sampled.tolist()),
        "dynamics_lipschitz": numbers(bounds.dynamics.lipschitz.tolist()),
        "sampled_dynamics_lipschitz": numbers(bounds.dynamics.sampled.tolist()),
        "speed": bounds.speed,
        "velocity_lipschitz": numbers(bounds.velocities.lipschitz.tolist()),
        "sampled_velocity_lipschitz": numbers(bounds.velocities.sampled.tolist()),
        "dynamics_size": numbers(bounds.dynamics_size.tolist()),
        "disturbance_size": numbers(bounds.disturbance_size.tolist()),
        "open": list(bounds.open),
    }
