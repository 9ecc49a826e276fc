"""The theorems for games with expressions, with constants that are proved over a box of joint actions.

The theorems ask for m, l_i and eta_i on the whole space. What their proofs use is less: that x, xbar and all
estimates stay where the constants hold. Here they hold in a box, so every statement is about the largest
sublevel set of V whose balls about x* lie in it: V falls on its border, so no trajectory leaves it. Where
dynamics depend on velocities, constants hold up to a speed, and so does the set.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import GameError
from ..fmu.model import Model, Value
from ..game.bounds import GameBounds, box_around, game_bounds
from ..game.parameters import GameParameters
from . import paper_bounds
from .analyst import LISTED, SHARPER, paper_thresholds
from .certificate import Certificate, best_certificate, sufficient_gains, theorem_2_thresholds
from .constants import NO_DYNAMICS, DynamicsConstants, dynamics_constants, loop_constants
from .design import K3_MARGIN, Design, design_within
from .domain import initial_errors
from .findings import Demonstration, Figure, Row
from .game import AnalysedGame, Gains, game_of_model, moving
from .hypotheses import BOUNDED, Hypothesis, connected_graph, gain_thresholds, told_for, unbounded_controls
from .spectrum import nash_equilibrium

FloatArray = NDArray[np.float64]

MARGIN = 1.1
"""The default box reaches so many times farther than the farthest start from x*."""

HALVINGS = 12
"""How often a default box is halved, at most, until m > 0 is proved."""

ROUNDS = 6
"""How often it is widened, at most, so that the set of the initial state fits in."""


@dataclass(frozen=True)
class BoxFindings:
    """What an analysis says of a box."""

    rows: tuple[Row, ...]
    hypotheses: tuple[Hypothesis, ...]
    demonstrations: tuple[Demonstration, ...]
    verdicts: tuple[str, ...]
    bounds: GameBounds | None


def box_analysis(
    model: Model,
    x_star: FloatArray,
    changes: Mapping[str, Value],
    *,
    box: float | None,
    speed: float | None,
    radius: float,
) -> BoxFindings:
    """Constants, thresholds and designed gains over a box.

    box: every action within this distance of x* (N, D); by default as far as the starts, farther where the
    set of the initial state asks for it, nearer where m > 0 is not proved. speed: no |v_jl| is larger; by
    default as at the start, larger where that set asks for it. radius: lim sup of |x - x*| that the designed
    gains guarantee. Raises GameError if the box or the speed is not positive, or if a speed is given and no
    dynamics depend on velocities.
    """
    for name, value in (("box", box), ("speed", speed)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise GameError(f"{name} = {value:g} is not positive")
    try:
        game = game_of_model(model, changes)
    except GameError as error:
        return BoxFindings((), (), (), (f"Theorems 1 and 2 are not judged: {error}.",), None)
    game = replace(game, parameters=replace(game.parameters, x_star=x_star))

    def bounds_within(distance: float, largest_speed: float) -> GameBounds:
        return game_bounds(model.path, box_around(x_star, distance), x_star, changes, speed=largest_speed)

    def judged(distance: float, largest_speed: float) -> _Judge:
        return _Judge(game, bounds_within(distance, largest_speed), distance, radius)

    first_speed = speed or 0.0
    if speed is None and "dynamics" in game.parameters.expressions:
        first_speed = MARGIN * fastest_start(game.parameters, bounds_within(0.0, 0.0).first_gradients)
    judge = _where_monotone(game.parameters, judged, first_speed) if box is None else judged(box, first_speed)
    if speed is not None and not judge.bounds.use_velocities:
        raise GameError("no dynamics of this game depend on velocities: its constants need no speed")
    return _widened(judge, judged, distance=box is None, speed=speed is None).findings()


def farthest_start(parameters: GameParameters) -> float:
    """Largest |x0 - x*|, |z0 - x*| or |y0 - x*| of a coordinate; 1 if all of them start there."""
    p, x_star = parameters, nash_equilibrium(parameters)
    references = p.z0[p.first_order] - x_star[p.first_order]
    starts = (p.x0 - x_star, references, p.y0 - x_star)
    largest = max(float(np.abs(each).max(initial=0.0)) for each in starts)
    return largest if largest > 0.0 else 1.0


def fastest_start(parameters: GameParameters, gradients: FloatArray) -> float:
    """Largest |v0| or k2 |grad_i f_i(y_i(0))| of a coordinate of order 2; 1 if all are 0.

    gradients (N, D) are grad_i f_i(y_i(0)). Where e is small, v is -k2 grad_i f_i(y_i).
    """
    second = ~parameters.first_order
    starts = (parameters.v0[second], parameters.k2 * gradients[second])
    largest = max(float(np.abs(each).max(initial=0.0)) for each in starts)
    return largest if 0.0 < largest < math.inf else 1.0


def _where_monotone(
    parameters: GameParameters, judged: "Callable[[float, float], _Judge]", speed: float
) -> "_Judge":
    """Over the box of the starts, or a nearer one if m > 0 is proved there alone."""
    farthest = MARGIN * farthest_start(parameters)
    judge = widest = judged(farthest, speed)
    for halving in range(1, HALVINGS + 1):
        if judge.bounds.monotone:
            break
        judge = judged(math.ldexp(farthest, -halving), speed)
    if not judge.bounds.monotone:
        return widest
    if judge is not widest:
        judge.is_nearer = True
        judge.verdicts.append(
            f"As far from x* as the starts, within {farthest:.3g}, no strong monotonicity is proved: m is "
            f"{widest.bounds.sampled_monotonicity:.4g} at sample points."
        )
    return judge


def _widened(
    judge: "_Judge", judged: "Callable[[float, float], _Judge]", *, distance: bool, speed: bool
) -> "_Judge":
    """Over a box and up to a speed that the set of the initial state fits in, if that is soon found."""
    for _ in range(ROUNDS):
        own = wanted = (judge.distance, judge.bounds.speed)
        design = judge.design() if judge.applicable else None
        if design is None:
            break
        farther, faster = judge.reach_for_start(design)
        if distance and not judge.is_nearer:
            wanted = (max(wanted[0], MARGIN * farther), wanted[1])
        if speed and judge.bounds.use_velocities:
            wanted = (wanted[0], max(wanted[1], MARGIN * faster))
        if wanted == own:
            break
        wider = judged(*wanted)
        found = wider.design() if wider.applicable else None
        if found is None or wider.share(found) <= judge.share(design):
            break
        wider.is_nearer, wider.verdicts = judge.is_nearer, judge.verdicts
        judge = wider
    return judge


class _Judge:
    """Goes through one game with bounds over one box."""

    def __init__(self, game: AnalysedGame, bounds: GameBounds, distance: float, radius: float) -> None:
        parameters = replace(game.parameters, bounds=bounds, disturbance_bound=bounds.disturbance_size)
        self.game, self.bounds = replace(game, parameters=parameters), bounds
        self.distance, self.radius = distance, radius
        self.constants = loop_constants(parameters)
        self.rows: list[Row] = []
        self.verdicts: list[str] = []
        self.is_nearer = False  # than the starts are

    @property
    def where(self) -> str:
        return f"where every action is within {self.distance:.3g} of x*"

    @property
    def where_slow(self) -> str:
        """The same for what depends on velocities, too."""
        slow = f" and no velocity's coordinate exceeds {self.bounds.speed:.3g}"
        return self.where + (slow if self.bounds.use_velocities else "")

    @property
    def largest_speed(self) -> float:
        return self.bounds.speed if self.bounds.use_velocities else math.inf

    @property
    def applicable(self) -> bool:
        """Whether graph and costs are those of the theorems, in the box."""
        return self.constants.slowest_consensus > 0.0 and self.bounds.monotone

    @property
    def dynamics(self) -> DynamicsConstants:
        return dynamics_constants(self.game.parameters, self.bounds.reach, self.bounds.reach)

    def start_level(self, certificate: Certificate, k2: float | None = None) -> float:
        """V(0), of V_1 to V_4, for the game's k2 or another."""
        parameters = self.game.parameters
        if k2 is not None:
            parameters = replace(parameters, k2=k2)
        return float(initial_errors(parameters).level(certificate.weights)[0])

    def reach_for_start(self, design: Design) -> tuple[float, float]:
        """Distance and speed at which the designed gains' sublevel set of the initial state fits in."""
        start, certificate = self.start_level(design.certificate), design.certificate
        distance = self.distance * math.sqrt(start / certificate.level_within(self.bounds.reach))
        return distance, certificate.velocity_radius(start, design.gains.k2)

    def share(self, design: Design) -> float:
        """Level of the designed gains' set over that of the start, which it holds from 1 on."""
        return design.domain.level / self.start_level(design.certificate)

    def design(self) -> Design | None:
        """Gains above all thresholds; None if there are none."""
        try:
            return design_within(
                self.game,
                k2=self.game.gains.k2,
                radius=self.radius,
                reach=self.bounds.reach,
                speed=self.largest_speed,
            )
        except ArithmeticError:
            return None

    def findings(self) -> BoxFindings:
        self._constants()
        hypotheses: tuple[Hypothesis, ...] = ()
        demonstrations: tuple[Demonstration, ...] = ()
        if self.applicable:
            if unbounded_controls(self.game.parameters):
                self.verdicts.append(BOUNDED)
            self._theorem_2()
            hypotheses = self._theorem_1()
            demonstrations = self._designed()
        return BoxFindings(tuple(self.rows), hypotheses, demonstrations, tuple(self.verdicts), self.bounds)

    def _row(self, section: str, name: str, value: Figure, unit: str, meaning: str) -> None:
        self.rows.append(Row(section, name, value, unit, meaning))

    def _constants(self) -> None:
        b, c = self.bounds, self.constants
        self._row("box", "distance", self.distance, "L", "of every action from x*, at most")
        self._row("box", "m", b.monotonicity, "1", "strong monotonicity there (Assumption 3), proved")
        self._row("box", "m sampled", b.sampled_monotonicity, "1", "smallest at sample points")
        kinds = [
            ("l", "1", b.gradients, "Lipschitz constant of the own gradient there (Assumption 1)"),
            ("eta", "1/s", b.dynamics, "Lipschitz constant of g there (Assumption 5)"),
        ]
        if b.use_velocities:
            self._row("box", "speed", b.speed, "L/s", "of every velocity's coordinate, at most")
            kinds.append(("nu", "1/s", b.velocities, "Lipschitz constant of g along velocities there"))
        for letter, unit, found, meaning in kinds:
            for kind, values in (("", found.lipschitz), (" sampled", found.sampled)):
                told = "proved" if not kind else "largest at sample points"
                if len(values) <= LISTED:
                    for i, value in enumerate(values.tolist(), start=1):
                        self._row("box", f"{letter}_{i}{kind}", value, unit, f"{meaning}, {told}")
                else:
                    self._row("box", f"max {letter}_i{kind}", float(values.max()), unit, f"{meaning}, {told}")
        self._row("box", "|g|", float(b.dynamics_size.max()), "L/s", "largest |g_il| there at rest, proved")
        self._row("box", "|d|", float(b.disturbance_size.max()), "L/s", "largest |d_il(t)|, proved")
        sampled = f"{b.sampled_monotonicity:.4g} at sample points"
        if b.monotone:
            told = f"strongly monotone {self.where}: m = {b.monotonicity:.4g} is proved, {sampled}"
        elif b.sampled_monotonicity <= 0.0:
            told = f"not strongly monotone {self.where}: m = {sampled}"
        else:
            told = f"not proved strongly monotone {self.where}: {sampled}"
        self.verdicts.append(f"The pseudo-gradient is {told}.")
        if b.open:
            self.verdicts.append(f"Not proved in that box: {'; '.join(_few(b.open))}.")
        if not c.slowest_consensus > 0.0:
            self.verdicts.append("Theorems 1 and 2 do not apply: the graph is not connected.")

    def _theorem_2(self) -> None:
        c, gains, name = self.constants, self.game.gains, "theorem 2"
        none = replace(NO_DYNAMICS, lipschitz=np.zeros(c.players))
        paper = paper_thresholds(self.game, c, paper_bounds.theorem_2_coefficients, none)
        for gain in paper_bounds.ORDER:
            meaning = f"the paper's threshold{told_for(gain, paper.counted)}"
            self._row(name, f"{gain}*", getattr(paper.limits, gain), "1/s", meaning)
        self._row(name, "met", paper.met, "1", "the paper's thresholds hold for the given gains")
        sharper = theorem_2_thresholds(c, gains.k2, margin=K3_MARGIN, given=gains)
        k3 = gains.k3 if gains.k3 > sharper.k3 else K3_MARGIN * sharper.k3
        self._row(name, "sharper k3*", sharper.k3, "1/s", f"comparison matrix, for k2 = {gains.k2:.4g}")
        self._row(name, "sharper k4*", sharper.k4, "1/s", f"the same, for k3 = {k3:.4g}")
        certificate = best_certificate(c, NO_DYNAMICS, gains, tracking=False)
        rate = min(0.5 * certificate.rate, gains.k1) if c.first_players else 0.5 * certificate.rate
        self._row(name, "sharper rate", rate, "1/s", "proved rate of |x - x*| for the given gains")
        asked = f"At k2 = {gains.k2:g} it asks k3 > {sharper.k3:.3g}"
        if c.second_players:
            asked += f" and, for k3 = {k3:.3g}, k4 > {sharper.k4:.3g}"
        if rate > 0.0:
            level = certificate.level_within(self.bounds.reach, tracking=False)
            start = self.start_level(certificate)
            self._row(name, "level", level, "L^2", "of V without x_f, up to which starts stay in the box")
            self._row(name, "V(0)", start, "L^2", "level of the game's start, the same weights")
            told = (
                f"Without perturbation the sharper certificate proves the rate {rate:.3g} 1/s of |x - x*| "
                f"for starts with V <= {level:.3g}; {_inside(start, level)}"
            )
        else:
            told = "The sharper certificate proves no rate for the given gains"
        any_k1 = ", and any k1 > 0," if c.first_players else ""
        self.verdicts.append(f"{told}. {asked} 1/s{any_k1} with the constants of the box.")

    def _theorem_1(self) -> tuple[Hypothesis, ...]:
        c, gains, name = self.constants, self.game.gains, "theorem 1"
        local = self.dynamics
        hypotheses = self._assumptions()
        if not math.isfinite(local.largest):
            self.verdicts.append(
                "Theorem 1 is not judged: it asks for Lipschitz constants of all g_i (Assumption 5)."
            )
            return tuple(hypotheses)
        paper = paper_thresholds(self.game, c, paper_bounds.theorem_1_coefficients, local)
        for gain in paper_bounds.ORDER:
            meaning = f"the paper's threshold{told_for(gain, paper.counted)}, with eta of the box"
            self._row(name, f"{gain}*", getattr(paper.limits, gain), "1/s", meaning)
        self._row(name, "met", paper.met, "1", "the paper's thresholds hold for the given gains")
        sharper = sufficient_gains(c, local, gains.k2, margin=K3_MARGIN, given=gains)
        k3 = gains.k3 if gains.k3 > sharper.k3 else K3_MARGIN * sharper.k3
        self._row(name, "sharper k3*", sharper.k3, "1/s", f"comparison matrix, for k2 = {gains.k2:.4g}")
        for gain, value in (("k1", sharper.k1), ("k4", sharper.k4)):
            self._row(name, f"sharper {gain}*", value, "1/s", f"the same, for k3 = {k3:.4g}")
        certificate = best_certificate(c, local, gains)
        self._row(name, "sharper rate", certificate.rate, "1/s", "proved rate of V; <= 0 proves nothing")
        hypotheses += [self._robust_term(gains), *gain_thresholds(self.game, paper.limits, paper.counted)]
        failing = [each for each in hypotheses if each.holds is False]
        undecided = [each for each in hypotheses if each.holds is None]
        if failing:
            told = "; ".join(f"{each.name} ({each.figures})" for each in failing)
            self.verdicts.append(f"Theorem 1 guarantees nothing for the given gains. What fails: {told}.")
        elif undecided:
            told = "; ".join(f"{each.name} ({each.figures})" for each in undecided)
            self.verdicts.append(f"No hypothesis of Theorem 1 fails for the given gains; open: {told}.")
        else:
            self.verdicts.append(
                f"Every hypothesis of Theorem 1 holds for the given gains {self.where_slow}."
            )
        return tuple(hypotheses)

    def _assumptions(self) -> list[Hypothesis]:
        b, c, p = self.bounds, self.constants, self.game.parameters
        eta, disturbed = float(b.dynamics.lipschitz.max()), float(b.disturbance_size.max())
        nu = float(b.velocities.lipschitz.max())
        along = f", max nu_i = {nu:.4g} where |v_jl| <= {b.speed:.4g}" if b.use_velocities else ""
        return [
            *unbounded_controls(p),
            Hypothesis(
                "Assumption 1 in the box: own gradients Lipschitz",
                holds=True,
                figures=f"max l_i = {c.largest_lipschitz:.4g}",
            ),
            connected_graph(p, c),
            Hypothesis(
                "Assumption 3 in the box: strongly monotone", holds=True, figures=f"m = {c.monotonicity:.4g}"
            ),
            Hypothesis(
                "Assumption 5 in the box: g Lipschitz, d bounded",
                holds=True if math.isfinite(eta + nu + disturbed) else None,
                figures=f"max eta_i = {eta:.4g}, max |d_il| = {disturbed:.4g}{along}",
            ),
        ]

    def _robust_term(self, gains: Gains) -> Hypothesis:
        enough = float((self.bounds.dynamics_size + self.bounds.disturbance_size).max())
        return Hypothesis(
            "delta >= |eps_il| + |d_il| in the box",
            holds=True if gains.delta >= enough else None,
            figures=f"delta = {gains.delta:.4g}; {enough:.4g} is enough (W* = 0)",
        )

    def _designed(self) -> tuple[Demonstration, ...]:
        design = self.design()
        if design is None or not math.isfinite(design.gains.delta):
            self.verdicts.append("No gains are designed: the constants that they need are not all proved.")
            return ()
        section = f"design: {SHARPER}"
        units = {"epsilon": "1", "W_max": "1", "delta": "L/s"}
        for key, value in moving(design.gains, self.game.parameters):
            self._row(section, key, value, units.get(key, "1/s"), "designed")
        start = self.start_level(design.certificate)
        ultimate = design.certificate.ultimate_level(design.gains, optimal_weight_norm=0.0)
        level = design.domain.level
        self._row(section, "K_0", design.certificate.rate, "1/s", "proved rate of V")
        self._row(section, "level", level, "L^2", "of V, up to which starts stay in the box")
        self._row(section, "V(0)", start, "L^2", "level of the game's start, the same weights")
        self._row(section, "guaranteed radius", design.radius, "L", "lim sup |x - x*|")
        self._row(
            section, "guaranteed settling time", design.settling_time, "s", "from when on 1.01 times it holds"
        )
        hypotheses = (
            *self._assumptions(),
            self._robust_term(design.gains),
            Hypothesis("W*'W* <= W_max", holds=True, figures="W* = 0 is admissible"),
            Hypothesis(
                "V' <= -K_0 V + c on the set",
                holds=design.certificate.rate > 0.0,
                figures=f"K_0 = {design.certificate.rate:.4g} 1/s",
            ),
            Hypothesis(
                "The set is invariant",
                holds=ultimate <= level,
                figures=f"c / K_0 = {ultimate:.4g}, level = {level:.4g}",
            ),
            Hypothesis(
                "The set holds the initial state",
                holds=start <= level,
                figures=f"V(0) = {start:.4g}, level = {level:.4g}",
            ),
        )
        shown = Demonstration(SHARPER, design, hypotheses, None, "constants are those of a box")
        self._row(section, "hypotheses hold", shown.complete, "1", "all of Theorem 1, on the set")
        gains = ", ".join(f"{key} = {value:.3g}" for key, value in moving(design.gains, self.game.parameters))
        self.verdicts.append(
            f"With {gains} (W* = 0: delta carries all of g) {SHARPER} guarantees the radius "
            f"{design.radius:.3g} after {design.settling_time:.3g} s from starts with V <= {level:.3g}; "
            f"{_inside(start, level)}."
        )
        return (shown,)


def _inside(start: float, level: float) -> str:
    return f"the game's start has V(0) = {start:.3g}, {'which is one' if start <= level else 'too much'}"


def _few(told: tuple[str, ...]) -> tuple[str, ...]:
    most = 3
    return told if len(told) <= most else (*told[:most], f"{len(told) - most} more")
