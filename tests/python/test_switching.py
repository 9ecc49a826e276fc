"""Games whose expressions switch: trajectories, events and indicators against formulas by hand."""

from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.special import ndtri

import mixed_order_game as mog
from mixed_order_game.fmu.build import build_fmu
from tests.conftest import FmuOf
from tests.three_players import head

K = 0.2784645427610738
HEAD = head()
H = np.array([4.0, 2.0, 1.5])
A = np.array([[0.0, 1.0, 1.0], [1.0, 0.0, 0.5], [1.0, 0.5, 0.0]])
SECOND = np.array([False, True, True])
Modes = dict[str, float]


def sequence(seed: int, k: int) -> float:
    """Number k of the normal sequence: NumPy's Philox advances its counter before the first word."""
    word = int(np.random.Philox(counter=(k - 1) % 2**256, key=seed).random_raw(1)[0])
    return float(ndtri(((word >> 12) + 0.5) / 2.0**52))


def gradients(y: np.ndarray, apart: float, above: float) -> np.ndarray:
    own = np.diag(y)
    gradient: np.ndarray = 2.0 * (own - H) + 0.3 * (y.sum(axis=1) - own)
    gradient[1] += 0.4 * apart
    gradient[2] += above * (own[2] - 0.2)
    return gradient


def rate(t: float, state: np.ndarray, modes: Modes) -> np.ndarray:
    x, reference, y, W = state[:3], state[3:6], state[6:15].reshape(3, 3), state[15:].reshape(4, 3)
    gradient = gradients(y, 2.0 * modes["apart"] - 1.0, modes["above"])
    shared = np.where(SECOND, x, reference)
    e = np.where(SECOND, reference + gradient, x - reference)
    S = np.array([np.exp(-((y - c) ** 2).sum(axis=1) / 25.0) for c in (-1.0, 0.0, 1.0, 2.0)])
    u = -np.where(SECOND, 20.0, 10.0) * e - (W * S).sum(axis=0) - 2.0 * np.tanh(K * 2.0 * e / 0.5)
    v = reference
    inside = modes["x2"] * (1.0 - modes["x3"])
    g = np.array(
        [
            0.0,
            0.8 * modes["sign"] - 0.5 * v[1] * abs(v[1]) + (0.6 if inside else -0.2),
            x[2]
            - 0.5 * modes["mod"]
            + 0.3 * modes["floor"]
            + (np.sqrt(max(x[2] - 0.3, 0.0)) if modes["root"] else 0.0)
            + min(x[1], x[2]),
        ]
    )
    d = np.array(
        [
            (0.5 if modes["square"] % 2 == 0 else -0.5) + 3.0 * modes["on"] * (1.0 - modes["off"]),
            sequence(7, int(modes["noise"])) + 0.5 * modes["step"] + 0.3 * modes["wave"],
            0.1 * modes["stairs"] + t - 0.9 * modes["teeth"],
        ]
    )
    driven = u + g + d
    y_rate = -50.0 * (A.sum(axis=1)[:, None] * y - A @ y + A * (y - shared))
    return np.concatenate(
        [
            np.where(SECOND, v, driven),
            np.where(SECOND, driven, -gradient),
            y_rate.ravel(),
            (5.0 * S * e).ravel(),
        ]
    )


# Conditions that hold from the zero of a quantity on, and those that count whole steps of one.
LOCATED: dict[str, Callable[[float, np.ndarray], float]] = {
    "apart": lambda _, s: s[6 + 4] - s[6 + 3],  # y_22 - y_21
    "above": lambda _, s: s[6 + 8] - 0.2,
    "sign": lambda _, s: s[0] - 1.5,
    "v": lambda _, s: s[4],
    "x2": lambda _, s: s[1] - 0.5,
    "x3": lambda _, s: s[2] - 1.0,
    "root": lambda _, s: s[2] - 0.3,
    "min": lambda _, s: s[2] - s[1],
    "wave": lambda t, _: np.sin(3.0 * t) - 0.5,
}
COUNTED: dict[str, Callable[[float, np.ndarray], float]] = {
    "mod": lambda _, s: s[2] / 0.5,
    "floor": lambda _, s: 2.0 * s[0],
}


def timed(t_end: float) -> list[tuple[float, str]]:
    """Time and name of every event that is known beforehand, after t = 0."""

    def series(name: str, time: Callable[[int], float]) -> list[tuple[float, str]]:
        return [(time(k), name) for k in range(1, 200) if 0.0 < time(k) < t_end]

    return sorted(
        [
            (1.1, "step"),
            (2.345, "on"),
            (2.345 + 0.001, "off"),
            *series("square", lambda k: (k - 1) * 0.85 + 0.3),
            *series("noise", lambda k: k * 0.4),
            *series("stairs", lambda k: (k - 0.2) / 1.5),
            *series("teeth", lambda k: k * 0.9),
        ]
    )


def by_hand(times: np.ndarray) -> tuple[np.ndarray, int]:
    """States at the times, and the number of events."""
    x0 = np.array([-0.6, 1.0, -0.5])
    state = np.concatenate([x0, [-0.6, 0.3, -0.1], np.zeros(9), np.zeros(12)])
    modes = dict.fromkeys(["on", "off", "step", "noise", "stairs", "teeth"], 0.0) | {"square": -1.0}
    modes |= {name: float(s(0.0, state) >= 0.0) for name, s in LOCATED.items()}
    modes["sign"] = 2.0 * modes["sign"] - 1.0
    modes |= {name: float(np.floor(s(0.0, state))) for name, s in COUNTED.items()}

    def margin(name: str) -> Callable[[float, np.ndarray], float]:
        """Positive while the present mode holds."""
        if name in LOCATED:
            sign = 1.0 if modes[name] > 0.0 else -1.0
            return lambda t, state: sign * LOCATED[name](t, state)
        k = modes[name]
        return lambda t, state: min(COUNTED[name](t, state) - k, k + 1.0 - COUNTED[name](t, state))

    found = np.zeros((len(times), len(state)))
    known = timed(times[-1])
    t, events = 0.0, 0
    while t < times[-1]:
        stop = known[0][0] if known else times[-1]
        names = [*LOCATED, *COUNTED]
        functions = [margin(name) for name in names]
        for function in functions:
            function.terminal, function.direction = True, -1.0  # type: ignore[attr-defined]
        wanted = times[(times >= t) & (times <= stop)]
        part = solve_ivp(
            lambda t, state: rate(t, state, modes), (t, stop), state, "DOP853",
            dense_output=True, rtol=1e-11, atol=1e-12, events=functions,
        )  # fmt: skip
        reached = part.t[-1]
        assert part.sol is not None
        for when in wanted[wanted <= reached]:
            found[np.searchsorted(times, when)] = part.sol(when)
        assert part.t_events is not None
        t, state = reached, part.y[:, -1]
        if part.status == 1:
            for name, at in zip(names, part.t_events, strict=True):
                if len(at) == 0:
                    continue
                events += 1
                if name in COUNTED:
                    modes[name] += 1.0 if COUNTED[name](t, state) > modes[name] + 0.5 else -1.0
                else:
                    modes[name] = -modes[name] if name == "sign" else 1.0 - modes[name]
        while known and known[0][0] == t:
            events += 1
            modes[known.pop(0)[1]] += 1.0
    return found, events


@pytest.fixture
def switching(fmu_of: FmuOf) -> Path:
    return fmu_of("switching")


def test_trajectory_and_events_are_those_of_the_formulas_by_hand(switching: Path) -> None:
    result = mog.run(
        switching, stop_time=3.95, step=0.05, tolerance=1e-8, outputs=["x", "v", "solver_events"]
    )
    expected, events = by_hand(np.asarray(result.time))
    assert np.abs(result.x[:, :, 0] - expected[:, :3]).max() < 2e-5
    assert np.asarray(result["solver_events"])[-1] == events
    assert events > 40


def test_model_exchange_agrees(switching: Path) -> None:
    description = fmpy.read_model_description(switching)
    assert description.numberOfEventIndicators == 3 + 2 + 9  # columns, costs, dynamics and sin(3 t) > 0.5
    names = ["x[1,1]", "x[2,1]", "x[3,1]"]
    options = {"stop_time": 4.0, "output_interval": 0.05, "output": [*names, "solver_events"]}
    exchanged = fmpy.simulate_fmu(
        switching, fmi_type="ModelExchange", relative_tolerance=1e-9, record_events=False, **options
    )
    stepped = fmpy.simulate_fmu(switching, fmi_type="CoSimulation", relative_tolerance=1e-9, **options)
    for name in names:
        assert np.abs(exchanged[name] - stepped[name]).max() < 2e-5
    assert exchanged["solver_events"][-1] == stepped["solver_events"][-1]


def test_equilibrium_takes_conditions_at_x(switching: Path) -> None:
    result = mog.run(switching, stop_time=0.01)

    def pseudo_gradient(x: np.ndarray) -> np.ndarray:
        return gradients(np.tile(x, (3, 1)), np.sign(x[1] - x[0]), float(x[2] > 0.2))

    solved = root(pseudo_gradient, H, tol=1e-14)
    assert np.abs(np.ravel(result.x_star) - solved.x).max() < 1e-10


def instantiated(fmu: Path, folder: Path) -> FMU2Slave:
    description = fmpy.read_model_description(fmu)
    fmpy.extract(str(fmu), unzipdir=folder)
    slave = FMU2Slave(
        guid=description.guid, modelIdentifier="MixedOrderGame", unzipDirectory=str(folder), instanceName="a"
    )
    slave.instantiate()
    slave.references = {each.name: each.valueReference for each in description.modelVariables}
    return slave


@pytest.fixture
def slave(switching: Path, tmp_path: Path) -> FMU2Slave:
    return instantiated(switching, tmp_path)


def started(slave: FMU2Slave, start_time: float = 0.0, tolerance: float = 1e-8) -> FMU2Slave:
    slave.setupExperiment(startTime=start_time, tolerance=tolerance)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def test_saved_states_continue_bit_for_bit(slave: FMU2Slave) -> None:
    names = ["x[1,1]", "x[2,1]", "x[3,1]", "v[2,1]", "u[3,1]", "nash_error"]
    wanted = [slave.references[name] for name in names]
    started(slave)
    events = [slave.references["solver_events"]]
    for n in range(14):
        slave.doStep(0.1 * n, 0.1)
    saved = slave.getFMUstate()
    content = slave.serializeFMUstate(saved)

    def rest() -> list[float]:
        values = []
        for n in range(14, 26):
            slave.doStep(0.1 * n, 0.1)
            values += slave.getReal(wanted) + slave.getInteger(events)
        return values

    first = rest()
    slave.setFMUstate(saved)
    assert rest() == first
    slave.setFMUstate(slave.deSerializeFMUstate(content, saved))
    assert rest() == first
    slave.freeInstance()


def test_a_change_of_a_parameter_plans_the_next_event_anew(slave: FMU2Slave) -> None:
    started(slave)
    events = [slave.references["solver_events"]]
    slave.doStep(0.0, 0.45)  # noise has changed at 0.4
    slave.setReal([slave.references["hold"]], [0.01])
    before = slave.getInteger(events)[0]
    slave.doStep(0.45, 0.0525)
    assert slave.getInteger(events)[0] - before >= 5
    slave.setReal([slave.references["hold"]], [0.0])
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.doStep(0.5025, 0.1)
    slave.setReal([slave.references["hold"]], [0.4])
    slave.doStep(0.5025, 0.1)
    slave.freeInstance()


def test_derivatives_are_those_of_the_held_branches(slave: FMU2Slave) -> None:
    started(slave)
    slave.doStep(0.0, 0.5)
    references = slave.references
    unknown, known = references["der(v[3,1])"], references["x[3,1]"]
    x2, x3 = slave.getReal([references["x[2,1]"], references["x[3,1]"]])
    found = slave.getDirectionalDerivative([unknown], [known], [1.0])[0]
    # mod and root by their slopes, min by its branch; the control does not see x_3 but through e = v + grad
    expected = 1.0 + (0.5 / np.sqrt(x3 - 0.3) if x3 > 0.3 else 0.0) + float(x3 <= x2)
    assert found == pytest.approx(expected, rel=1e-9)
    slave.freeInstance()


FRICTION = """
[defaults]
order = 2
cost = { quadratic = 1.0 }
x0 = 0.3
[[player]]
name = "a"
[[player]]
name = "b"
order = 1
[[player]]
name = "c"
v0 = 1.0
dynamics = { expression = "-40 * sign(v[3])" }
"""


@pytest.fixture(scope="module")
def friction(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("friction")
    (folder / "friction.toml").write_text(HEAD + FRICTION, encoding="utf-8")
    return build_fmu(folder / "friction.toml", folder / "friction.fmu")


def test_sliding_ends_in_a_message(friction: Path) -> None:
    with pytest.raises(mog.MixedOrderGameError) as ended:
        mog.run(friction, stop_time=5.0)
    assert '"sign(v[3])" in the dynamics of player 3 slides at t = ' in str(ended.value)
    assert "expected a smooth expression, such as tanh(s / width)" in str(ended.value)


FAR = """
[defaults]
order = 2
x0 = 0.0
cost = { quadratic = 1.0 }
[[player]]
name = "a"
disturbance = { expression = "pulse(t, %s, 1e-5) * 1e5 + if(mod(t, 1) < 0.5, 1, 0)" }
[[player]]
name = "b"
order = 1
[[player]]
name = "c"
"""


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_narrow_pulses_are_not_missed_whatever_the_time(start: float, tmp_path: Path) -> None:
    (tmp_path / "far.toml").write_text(HEAD + FAR % repr(start + 0.75), encoding="utf-8")
    fmu = build_fmu(tmp_path / "far.toml", tmp_path / "far.fmu")
    slave = started(instantiated(fmu, tmp_path), start)
    v = [slave.references["v[1,1]"]]
    slave.doStep(start, 0.75)
    before = slave.getReal(v)[0]
    slave.doStep(start + 0.75, 0.015625)
    assert slave.getReal(v)[0] - before > 0.5
    slave.doStep(start + 0.765625, 2.0 - 0.765625)
    # the pulse; mod and the condition on it, at 0.5, 1, 1.5 and 2
    assert slave.getInteger([slave.references["solver_events"]])[0] == 2 + 1 + 2 + 1 + 2
    slave.freeInstance()
