"""Goes through one game step by step and collects the rows, hypotheses, demonstrations and verdicts."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ..errors import GameError, SimulationError
from ..fmu.model import Model, Value
from . import paper_bounds
from .certificate import (
    Certificate,
    SufficientGains,
    best_certificate,
    sufficient_gains,
    theorem_2_rate,
    theorem_2_thresholds,
)
from .constants import NO_DYNAMICS, DynamicsConstants, LoopConstants, dynamics_constants, loop_constants
from .design import K3_MARGIN, Design, paper_constants, paper_design, sharper_design
from .domain import Domain, domain, initial_errors
from .exact_loop import (
    LARGEST_LINEAR_LOOP,
    LARGEST_SEARCH,
    SETTLED,
    SPAN,
    ExactLoop,
    exact_ceiling,
    exact_loop,
    exact_threshold,
)
from .findings import Analysis, Demonstration, Figure, Progress, Row
from .game import AnalysedGame, Gains, moving
from .growing_modes import AT_LEAST, stability
from .hypotheses import (
    BOUNDED,
    Hypothesis,
    design_hypotheses,
    gain_thresholds,
    largest_representable_radius,
    robust_term,
    standing_assumptions,
    told_for,
    unbounded_controls,
    weight_bound,
)
from .lyapunov import scaled_identity
from .network_fit import NetworkFit, least_squares_fit, mirror_bound, trajectory_fit
from .paper_bounds import ORDER, Formula, PaperConstants, Thresholds
from .simulation import Seen, integration_error, simulate
from .spectrum import nash_equilibrium

FloatArray = NDArray[np.float64]

DEFAULT_STOP = 20.0
"""End of the runs with the game's own gains in s, when the FMU does not say."""

SETTLED_PART = 0.8
"""A run's radius is judged over the rest after this part of it."""

SHARPER, PAPER = "the sharper certificate", "the paper's constants"
"""Names of the two designs."""

COUNTED_MARGIN = 1.1
"""Factor over its threshold at which a gain that does not exceed it counts in the thresholds after it."""

LISTED = 10
"""Most players whose constants get a row each; larger games get ranges."""


class Analyst:
    """Collects the rows of one analysis."""

    def __init__(
        self,
        game: AnalysedGame,
        model: Model | None,
        changes: Mapping[str, Value],
        radius: float,
        progress: Progress | None,
    ) -> None:
        self.game, self.changes, self.radius = game, changes, radius
        self.fmu = None if model is None else model.path
        self.progress = progress
        try:
            nash_equilibrium(game.parameters)
        except GameError as error:
            raise GameError(f"{game.path}: {error}") from error
        self.constants = loop_constants(game.parameters)
        self.assumptions = standing_assumptions(game, self.constants)
        self.rows: list[Row] = []
        self.verdicts: list[str] = []
        self.stable: bool | None = None  # the unperturbed loop
        self.stop_time = DEFAULT_STOP if model is None else model.stop_time

    def analysis(self, path: Path) -> Analysis:
        """Everything, in the order of the output; path is what the user named."""
        self._report("constants", 0.0)
        self._constants()
        exact = self._exact()
        self._theorem_2()
        paper = self._theorem_1()
        runs = self._runs(exact)
        hypotheses = self._own_gains(paper, runs.get("robust"))
        demonstrations = self._demonstrations()
        self._report("demonstration", 1.0)
        return Analysis(
            title=self.game.title,
            path=path,
            rows=tuple(self.rows),
            hypotheses=tuple(hypotheses),
            demonstrations=tuple(demonstrations),
            verdicts=tuple(self.verdicts),
            constants=self.constants,
            exact=exact,
            runs=runs,
        )

    @property
    def _applicable(self) -> bool:
        """Whether graph and costs are those of the theorems: connected, strongly monotone."""
        return self.constants.slowest_consensus > 0.0 and self.constants.monotonicity > 0.0

    def _report(self, name: str, part: float) -> None:
        if self.progress is not None:
            self.progress(name, part)

    def _row(self, section: str, name: str, value: Figure, unit: str, meaning: str) -> None:
        self.rows.append(Row(section, name, value, unit, meaning))

    def _constants(self) -> None:
        c, p = self.constants, self.game.parameters
        own = dynamics_constants(p)
        self._row("game", "m", c.monotonicity, "1", "strong monotonicity (Assumption 3)")
        self._players("game", "l", c.lipschitz, "1", "Lipschitz constant of the own gradient (Assumption 1)")
        self._row("game", "||h||", c.pseudo_gradient_norm, "1", "Lipschitz constant of the pseudo-gradient")
        bound = math.sqrt(c.players) * c.largest_lipschitz
        self._row("game", "sqrt(N) max l_i", bound, "1", "the paper's bound of ||h||")
        self._row("game", "||H_1||", c.hessian_norm, "1", "Hessian rows of order 2 (Assumption 4)")
        self._row("game", "b", c.paper_b, "1", "||H_1|| ||L (x) I + A_0||, as in the paper")
        self._row("game", "||B_s M||", c.exact_b, "1", "what b bounds")
        self._players("game", "eta", own.lipschitz, "1/s", "global Lipschitz constant of g (Assumption 5)")
        for j, eigenvalues in enumerate(c.eigenvalues[: LISTED + 1], start=1):
            if c.players <= LISTED:
                text = ", ".join(f"{value:.4g}" for value in eigenvalues)
                matrix = f"L + diag(a_.{j})"
                matrix = f"sym({matrix})" if p.directed else matrix
                self._row("graph", f"eig({matrix})", text, "1", f"consensus on player {j}'s action")
        if p.directed:
            meaning = "M = L (x) I + A_0 is not symmetric; P = p I gives M'P + P M = p (M + M')"
            self._row("graph", "lambda_min((M + M')/2)", c.slowest_consensus, "1", meaning)
        else:
            meaning = "slowest consensus, M = L (x) I + A_0"
            self._row("graph", "lambda_min(M)", c.slowest_consensus, "1", meaning)
        self._row("graph", "||M||", c.fastest_consensus, "1", "fastest consensus")

    def _players(self, section: str, letter: str, values: FloatArray, unit: str, meaning: str) -> None:
        """A row for each player, or two for a large game."""
        if len(values) <= LISTED:
            for i, value in enumerate(values.tolist(), start=1):
                self._row(section, f"{letter}_{i}", value, unit, meaning)
        else:
            self._row(section, f"min {letter}_i", float(values.min()), unit, meaning)
            self._row(section, f"max {letter}_i", float(values.max()), unit, meaning)

    def _exact(self) -> ExactLoop | None:
        p = self.game.parameters
        if p.players > LARGEST_LINEAR_LOOP:
            states = 2 * p.players + p.players**2
            self._row("exact", "states", states, "1", "of a coordinate, too many for their eigenvalues")
            self._report("counting eigenvalues", 0.0)
            judged = stability(p)
            self.stable = judged.stable
            if judged.stable is not None:
                meaning = "unperturbed loop exponentially stable"
                self._row("exact", "stable", judged.stable, "1", meaning)
            if judged.rate > 0.0:
                self._row("exact", "slowest rate", judged.rate, "1/s", AT_LEAST)
            begin = {
                True: "these gains converge exponentially",
                False: "these gains do not converge",
                None: "stability is not decided",
            }[judged.stable]
            self.verdicts.append(f"Without perturbation {begin}: {judged.told}.")
            return None
        exact = exact_loop(p)
        self.stable = exact.stable
        self._row("exact", "stable", exact.stable, "1", "unperturbed loop exponentially stable")
        self._row("exact", "slowest rate", -exact.abscissa, "1/s", "minus the spectral abscissa")
        part = f"{100.0 * SETTLED:.0f} %"
        self._row(
            "exact", "settling time", exact.settling_time, "s", f"predicted, |x - x*| to {part} of its start"
        )
        reach = ""
        if p.players <= LARGEST_SEARCH:
            limits = {name: exact_threshold(p, name, span=SPAN) for name in ("k3", "k4")}
            for name, value in limits.items():
                own = getattr(p, name)
                meaning = (
                    f"stable from it to {own * SPAN:.3g}, tried from {own / SPAN:.3g} on; others as given"
                )
                self._row("exact", f"least {name}", value, "1/s", meaning)
            k2, k3 = self.game.gains.k2, self.game.gains.k3
            meaning = f"stable from {k2 / SPAN:.3g} to it, tried up to {k2 * SPAN:.3g}; others as given"
            self._row("exact", "greatest k2", exact_ceiling(p, "k2", span=SPAN), "1/s", meaning)
            if math.isfinite(limits["k3"]):
                least = max(limits["k3"], k3 / SPAN)
                reach = f" With the other gains given they do for k3 from {least:.3g} to {k3 * SPAN:.3g} 1/s."
        self.verdicts.append(
            (
                "Without perturbation these gains converge exponentially:"
                f" slowest rate {-exact.abscissa:.4g} 1/s,"
                f" {part} of the start's error after {exact.settling_time:.3g} s."
                if exact.stable
                else "Without perturbation these gains do not converge: an eigenvalue has real part"
                f" {exact.abscissa:.4g} 1/s."
            )
            + reach
        )
        return exact

    def _theorem_2(self) -> None:
        c, gains, name = self.constants, self.game.gains, "theorem 2"
        if not self._applicable:
            missing = [each for each in self.assumptions[1:3] if not each.holds]
            told = "; ".join(f"{each.name}, fails ({each.figures})" for each in missing)
            self.verdicts.append(f"Theorems 1 and 2 do not apply: {told}.")
            return
        if unbounded_controls(self.game.parameters):
            self.verdicts.append(BOUNDED)
        none = replace(NO_DYNAMICS, lipschitz=np.zeros(c.players))
        paper = paper_thresholds(self.game, c, paper_bounds.theorem_2_coefficients, none)
        self._paper_rows(name, paper)
        self._row(name, "met", paper.met, "1", "the paper's thresholds hold for the given gains")
        sharper = theorem_2_thresholds(c, gains.k2, margin=K3_MARGIN, given=gains)
        self._sharper_rows(name, sharper)
        rate = theorem_2_rate(c, gains)
        self._row(
            name,
            "sharper rate",
            rate,
            "1/s",
            "proved rate of |x - x*| for the given gains; <= 0 proves nothing",
        )
        missed = [each for each in gain_thresholds(self.game, paper.limits, paper.counted) if not each.holds]
        if paper.met:
            self.verdicts.append("Theorem 2 holds for the given gains: every gain exceeds its threshold.")
        else:
            told = "; ".join(f"{each.name} ({each.figures})" for each in missed)
            sufficient = " The loop is stable all the same: the theorem is sufficient, not necessary."
            self.verdicts.append(
                f"Theorem 2 guarantees nothing for the given gains. What fails: {told}."
                + (sufficient if self.stable else "")
            )
        needs = f"k3 > {sharper.k3:.3g}"
        if c.second_players:
            needs += f" and, for k3 = {self._counted_k3(sharper):.3g}, k4 > {sharper.k4:.3g}"
        self.verdicts.append(
            (
                f"The sharper certificate proves the rate {rate:.3g} 1/s of |x - x*| without perturbation."
                if rate > 0.0
                else "The sharper certificate proves no rate either."
                if not paper.met
                else "The sharper certificate proves no rate."
            )
            + f" At k2 = {gains.k2:g} it asks {needs} 1/s{', and any k1 > 0' if c.first_players else ''}."
        )

    def _counted_k3(self, sharper: SufficientGains) -> float:
        """The k3 that the sharper k1* and k4* are for."""
        return self.game.gains.k3 if self.game.gains.k3 > sharper.k3 else K3_MARGIN * sharper.k3

    def _theorem_1(self) -> "PaperThresholds | None":
        c, gains, name = self.constants, self.game.gains, "theorem 1"
        if not self._applicable:
            return None
        weights = sufficient_gains(c, NO_DYNAMICS, gains.k2, rate=gains.k2 * c.monotonicity).weights
        level = float(initial_errors(self.game.parameters).level(weights)[0])
        set_of_start = domain(Certificate(c, weights, 0.0), level)
        self._row(name, "V(0)", level, "L^2", "level of the initial state, sharper weights")
        self._domain_rows(name, "V(0)", set_of_start)
        local = dynamics_constants(
            self.game.parameters, set_of_start.action_radius, set_of_start.estimate_radius
        )
        self._row(name, "eta on set", local.largest, "1/s", "largest Lipschitz constant of g on that set")
        paper = paper_thresholds(self.game, c, paper_bounds.theorem_1_coefficients, local)
        self._paper_rows(name, paper)
        self._row(
            name,
            "met",
            paper.met,
            "1",
            "the paper's thresholds hold for the given gains, with eta on that set",
        )
        for label, coordinates in (("printed", 1), ("with D coordinates", c.dimension)):
            constants = paper_constants(self.game, c, p=paper.p, dynamics=local, coordinates=coordinates)
            coefficients = paper_bounds.theorem_1_coefficients(constants, gains)
            for kind, level_of in (
                ("", paper_bounds.ultimate_level),
                (", sharper", paper_bounds.sharper_ultimate_level),
            ):
                value = paper_bounds.action_radius(
                    level_of(constants, gains, coefficients), first_players=c.first_players
                )
                self._row(
                    name, f"radius {label}{kind}", value, "L", "lim sup |x - x*| if delta suffices; inf: none"
                )
        self._printed_demand(paper_constants(self.game, c, p=paper.p, dynamics=local))
        self._sharper_rows(name, sufficient_gains(c, local, gains.k2, margin=K3_MARGIN, given=gains))
        certificate = best_certificate(c, local, gains)
        self._row(name, "sharper rate", certificate.rate, "1/s", "proved rate of V; <= 0 proves nothing")
        own = (
            certificate.action_radius(certificate.ultimate_level(gains))
            if certificate.rate > 0.0
            else math.inf
        )
        self._row(
            name,
            "sharper radius",
            own,
            "L",
            "lim sup |x - x*| by the sharper certificate, if delta suffices and the run stays in that set",
        )
        return paper

    def _printed_demand(self, constants: PaperConstants) -> None:
        """What the printed level of V, with its factor 1, asks for the wished radius: K and with it k4."""
        gains = self.game.gains
        columns = constants.players * constants.coordinates
        level = (self.radius / paper_bounds.action_radius(1.0, first_players=constants.first_players)) ** 2
        rate = columns * (gains.epsilon + 4.0 * gains.W_max) / level

        def asked(log_p: float) -> float:
            pair = scaled_identity(self.constants.slowest_consensus, math.exp(log_p))
            formula = paper_bounds.theorem_1_coefficients
            return paper_bounds.gains_for_rate(formula, replace(constants, pair=pair), gains, rate).k4

        best = minimize_scalar(lambda log_p: math.log(asked(log_p)), bounds=(-12.0, 12.0), method="bounded")
        meaning = f"to guarantee {self.radius:g} by the printed level (N D epsilon + 4 N D W_max)/K"
        self._row("theorem 1", "K asked by print", rate, "1/s", meaning)
        if self.constants.second_players:
            self._row(
                "theorem 1", "k4 asked by print", asked(float(best.x)), "1/s", "the least that has this K"
            )

    def _runs(self, exact: ExactLoop | None) -> dict[str, Seen]:
        if self.fmu is None:
            self.verdicts.append("No simulation was made.")
            return {}
        runs: dict[str, Seen] = {}
        settled = exact.settling_time if exact is not None and exact.stable else self.stop_time
        for name, stop, flag in (
            ("robust", self.stop_time, True),
            ("plain", min(4.0 * settled, self.stop_time), False),
        ):
            self._report(f"simulating {name}", 0.0)
            try:
                seen = simulate(
                    self.fmu, self.game, stop_time=stop, changes=self.changes, robust=flag, perturbed=flag
                )
            except SimulationError as error:
                self.verdicts.append(f"The {name} run is missing: {error}")
                continue
            finally:
                self._report(f"simulating {name}", 1.0)
            runs[name] = seen
        if "plain" in runs and exact is not None and exact.stable:
            time = runs["plain"].settling_time(SETTLED)
            self._row(
                "simulation", "settling time", time, "s", "unperturbed run, |x - x*| to 2 % of its start"
            )
        if "robust" in runs:
            self._seen_rows(runs["robust"])
        return runs

    def _seen_rows(self, seen: Seen) -> None:
        begin = SETTLED_PART * self.stop_time
        since = f"from {begin:g} s on"
        self._row("simulation", "radius", seen.radius(begin), "L", f"largest |x - x*| {since}, given gains")
        self._row("simulation", "mean radius", seen.root_mean_square(begin), "L", f"root mean square {since}")
        if seen.errors is None:
            self.verdicts.append(
                "Estimates along the runs, and V with them, are not known: the game is too large for its FMU "
                "to show them unless its file asks for it."
            )
        else:
            farthest = float(seen.errors.largest_estimate.max())
            self._row("simulation", "max |y_i - x*|", farthest, "L", "over the run")
        self._row("simulation", "max |x - x*|", float(seen.error.max()), "L", "over the run")
        self._row("simulation", "max w'w", seen.largest_weight_norm2, "1", "largest weight column")

    def _own_gains(self, paper: "PaperThresholds | None", seen: Seen | None) -> list[Hypothesis]:
        """The hypotheses of Theorem 1 for the given gains, on the smallest set known to hold the run."""
        game, c = self.game, self.constants
        found = [*unbounded_controls(game.parameters), *self.assumptions]
        begin = SETTLED_PART * self.stop_time
        stays = (
            f"stays within {seen.radius(begin):.3g} of the equilibrium from {begin:g} s on." if seen else ""
        )
        if paper is None:
            if seen is not None:
                self.verdicts.append(f"The run with the given gains {stays}")
            return found
        weights = sufficient_gains(c, NO_DYNAMICS, game.gains.k2, rate=game.gains.k2 * c.monotonicity).weights
        level = float(initial_errors(game.parameters).level(weights)[0])
        if seen is not None and seen.errors is not None:
            level = max(level, float(seen.errors.level(weights).max()))
            self._row("network", "level seen", level, "L^2", "largest V along the run, sharper weights")
        on_set = domain(Certificate(c, weights, 0.0), level)
        self._domain_rows("network", "level", on_set)
        fit = least_squares_fit(game, on_set.estimate_radius, W_max=game.gains.W_max)
        self._fit_rows("on the set", fit, mirror_bound(game, on_set.estimate_radius).max())
        reach = largest_representable_radius(game)
        self._row(
            "network", "largest |y_i - x*| for delta", reach, "L", "beyond it delta is too small for any W*"
        )
        if seen is not None and seen.y is not None:
            along = trajectory_fit(game, seen.x, seen.y, W_max=game.gains.W_max)
            self._fit_rows("along the run", along, None)
            needed = float((along.residual + game.parameters.disturbance_bound).max())
            self._row(
                "network", "delta enough along the run", needed, "L/s", "residual of that fit plus |d_il|"
            )
            outer = trajectory_fit(game, seen.x, seen.y, W_max=game.gains.W_max * len(game.centers))
            least = float((outer.residual + game.parameters.disturbance_bound).max())
            self._row(
                "network", "delta needed along the run", least, "L/s", "no admissible W* does with less"
            )
            if least > game.gains.delta:
                self.verdicts.append(
                    f"Along the run itself delta = {game.gains.delta:g} is too small for every W*:"
                    f" {least:.3g} is needed."
                )
        found += [
            robust_term(game, on_set),
            weight_bound(game, fit),
            *gain_thresholds(game, paper.limits, paper.counted),
        ]
        failing = [each for each in found if each.holds is False]
        if failing:
            told = "; ".join(f"{each.name} ({each.figures})" for each in failing)
            self.verdicts.append(f"Theorem 1 guarantees nothing for the given gains. What fails: {told}.")
            if seen is not None:
                self.verdicts.append(f"Yet the run with the given gains {stays}")
        elif undecided := [f"{each.name} ({each.figures})" for each in found if each.holds is None]:
            self.verdicts.append(
                f"No hypothesis of Theorem 1 fails for the given gains; open: {'; '.join(undecided)}."
            )
        else:
            self.verdicts.append(
                "Every hypothesis of Theorem 1 holds for the given gains where"
                f" |y_i - x*| <= {on_set.estimate_radius:.3g}."
            )
        return found

    def _fit_rows(self, where: str, fit: NetworkFit, mirror: float | None) -> None:
        found = float(fit.residual.max())
        least = found if mirror is None else max(found, float(mirror))
        self._row(
            "network", f"residual {where}", least, "L/s", "largest |g_il - W*'S| known for the fitted W*"
        )
        self._row(
            "network",
            f"dynamics {where}",
            float(fit.dynamics.max()),
            "L/s",
            "largest |g_il| found, residual of W* = 0",
        )
        self._row(
            "network", f"W*'W* {where}", float(fit.weight_norm2.max()), "1", "largest column of the fitted W*"
        )

    def _demonstrations(self) -> list[Demonstration]:
        game = self.game
        if not self._applicable:
            return []
        demonstrations = []
        for name in (SHARPER, PAPER):
            self._report("demonstration", 0.0)
            try:
                if name == SHARPER:
                    design = sharper_design(game, k2=game.gains.k2, radius=self.radius)
                else:
                    design = paper_design(game, radius=self.radius)
            except ArithmeticError as error:
                self.verdicts.append(f"With {name} no gains are found: {error}.")
                continue
            demonstrations.append(self._demonstration(name, design))
        return demonstrations

    def _demonstration(self, name: str, design: Design) -> Demonstration:
        seen, failure = None, "not asked for"
        if self.fmu is not None:
            try:
                stop = 2.0 * design.settling_time
                seen = simulate(self.fmu, self.game, stop_time=stop, gains=design.gains, changes=self.changes)
                failure = ""
            except SimulationError as error:
                failure = str(error)
        shown = Demonstration(name, design, tuple(design_hypotheses(self.game, design)), seen, failure)
        section = f"design: {name}"
        for key, value in moving(design.gains, self.game.parameters):
            self._row(
                section,
                key,
                value,
                {"epsilon": "1", "W_max": "1", "delta": "L/s"}.get(key, "1/s"),
                "designed",
            )
        self._row(section, "K_0", design.certificate.rate, "1/s", "proved rate of V")
        self._domain_rows(section, "level", design.domain)
        self._row(
            section,
            "eta on set",
            design.dynamics.largest,
            "1/s",
            "largest Lipschitz constant of g on the set",
        )
        self._row(
            section, "residual on set", design.residual, "L/s", "proved bound of |g_il - W*'S| for W* = 0"
        )
        self._row(section, "hypotheses hold", shown.complete, "1", "all of Theorem 1, on the set")
        self._row(section, "guaranteed radius", design.radius, "L", "lim sup |x - x*|")
        self._row(
            section,
            "guaranteed mean radius",
            design.mean_radius,
            "L",
            "lim sup of the root mean square over time",
        )
        self._row(
            section,
            "guaranteed settling time",
            design.settling_time,
            "s",
            "from when on 1.01 times the radius holds",
        )
        whole = "every hypothesis of Theorem 1 holds" if shown.complete else "not every hypothesis holds"
        gains = ", ".join(f"{key} = {value:.3g}" for key, value in moving(design.gains, self.game.parameters))
        told = f"By {name} {whole} on the set |y_i - x*| <= {design.domain.estimate_radius:.3g} with {gains}"
        told += " (W* = 0: delta carries all of g)"
        told += f"; guaranteed radius {design.radius:.3g} after {design.settling_time:.3g} s"
        if seen is None:
            self.verdicts.append(f"{told}; not simulated: {failure}.")
            return shown
        seen_radius = shown.seen_radius
        floor = integration_error(self.game.parameters)
        conservatism = design.radius / max(seen_radius, floor)
        self._row(section, "seen radius", seen_radius, "L", "largest |x - x*| after that time in the run")
        self._row(section, "run's tolerance", floor, "L", "what the integrator may add to |x - x*|")
        self._row(section, "conservatism", conservatism, "1", "guaranteed radius over the larger of the two")
        if seen.errors is not None:
            farthest = float(seen.errors.largest_estimate.max())
            self._row(section, "seen max |y_i - x*|", farthest, "L", "within the set")
        self._row(
            section, "seen max |u_il|", seen.largest_control, "L/s^order", "largest control, in the transient"
        )
        found = (
            f"seen {seen_radius:.3g}, {conservatism:.3g} times smaller"
            if seen_radius > floor
            else f"seen less than the run's tolerance {floor:.3g}, more than {conservatism:.3g} times smaller"
        )
        self.verdicts.append(f"{told}; {found} (largest control {seen.largest_control:.3g}).")
        return shown

    def _domain_rows(self, section: str, of: str, found: Domain) -> None:
        self._row(section, f"|x - x*| on {of}", found.action_radius, "L", "largest on the sublevel set")
        self._row(section, f"|y_i - x*| on {of}", found.estimate_radius, "L", "largest on the sublevel set")

    def _paper_rows(self, section: str, paper: "PaperThresholds") -> None:
        c = self.constants
        self._row(section, "p", paper.p, "1", "P = p I, Q = 2 p (L (x) I + A_0)")
        self._row(section, "lambda_min(Q)", 2.0 * paper.p * c.slowest_consensus, "1", "of that choice")
        for name in ORDER:
            meaning = f"the paper's threshold{told_for(name, paper.counted)}"
            self._row(section, f"{name}*", getattr(paper.limits, name), "1/s", meaning)

    def _sharper_rows(self, section: str, sharper: SufficientGains) -> None:
        k2, k3 = self.game.gains.k2, self._counted_k3(sharper)
        self._row(section, "sharper k3*", sharper.k3, "1/s", f"comparison matrix, for k2 = {k2:.4g}")
        meaning = f"the same, for k3 = {k3:.4g}"
        self._row(section, "sharper k1*", sharper.k1, "1/s", meaning)
        self._row(section, "sharper k4*", sharper.k4, "1/s", meaning)


@dataclass(frozen=True)
class PaperThresholds:
    """The paper's thresholds for P = p I, the gains they are for, and whether the given ones meet them."""

    p: float
    limits: Thresholds
    counted: Gains
    met: bool


def paper_thresholds(
    game: AnalysedGame, c: LoopConstants, formula: Formula, dynamics: DynamicsConstants
) -> PaperThresholds:
    """Thresholds for the given gains, see `thresholds_for`, and a p that has them all met if there is one.

    The coefficients are concave in p, so the p that makes the smallest one largest tells whether the given
    gains meet them. Otherwise p is the one for which they lack least: the product of the factors by which
    gains must rise is smallest.
    """
    gains = game.gains
    start = paper_constants(game, c, p=1.0, dynamics=dynamics)

    def constants(log_p: float) -> PaperConstants:
        return replace(start, pair=scaled_identity(c.slowest_consensus, math.exp(log_p)))

    def lacking(log_p: float) -> float:
        limits, _ = paper_bounds.thresholds_for(formula, constants(log_p), gains, COUNTED_MARGIN)
        ratios = [getattr(limits, name) / getattr(gains, name) for name in ORDER]
        return sum(math.log(ratio) for ratio in ratios if ratio > 1.0)

    log_p = _minimum(lambda each: -formula(constants(each), gains).smallest)
    met = formula(constants(log_p), gains).smallest > 0.0
    if not met:
        log_p = _minimum(lacking)
    limits, counted = paper_bounds.thresholds_for(formula, constants(log_p), gains, COUNTED_MARGIN)
    return PaperThresholds(math.exp(log_p), limits, counted, met)


def _minimum(function: Callable[[float], float]) -> float:
    """Where a function of log(p) is smallest: on a grid, then between the neighbours of its best point."""
    grid = np.linspace(-30.0, 10.0, 121)
    best = float(grid[int(np.argmin([function(each) for each in grid.tolist()]))])
    step = float(grid[1] - grid[0])
    found = minimize_scalar(function, bounds=(best - step, best + step), method="bounded")
    return float(found.x) if found.fun < function(best) else best
