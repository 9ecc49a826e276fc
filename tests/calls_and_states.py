"""Which function of FMI 2.0 the FMU allows in which state, found by calling each one in each state."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer, pointer
from pathlib import Path
from typing import Any, Self

import fmpy

OK = 0
FRESH, INITIALIZING, RUNNING, ENDED, FAILED = (
    "instantiated",
    "initialization mode",
    "step complete",
    "terminated",
    "error",
)
AT_EVENT, CONTINUOUS = "event mode", "continuous-time mode"
EVERY = frozenset((FRESH, INITIALIZING, RUNNING, AT_EVENT, CONTINUOUS, ENDED, FAILED))
READ = EVERY - {FRESH}
NONE: frozenset[str] = frozenset()

STANDARD: Mapping[str, frozenset[str]] = {
    "fmi2GetTypesPlatform": EVERY,
    "fmi2GetVersion": EVERY,
    "fmi2SetDebugLogging": EVERY,
    "fmi2FreeInstance": EVERY,
    "fmi2SetupExperiment": frozenset({FRESH}),
    "fmi2EnterInitializationMode": frozenset({FRESH}),
    "fmi2ExitInitializationMode": frozenset({INITIALIZING}),
    "fmi2Terminate": frozenset({RUNNING, AT_EVENT, CONTINUOUS}),
    "fmi2Reset": EVERY,
    "fmi2GetReal (output)": READ,
    "fmi2GetReal (initial unknown)": READ,
    "fmi2GetReal (parameter)": READ - {INITIALIZING},
    "fmi2GetInteger (local variable)": READ - {INITIALIZING},
    "fmi2GetBoolean (parameter)": READ - {INITIALIZING},
    "fmi2GetString (no variable)": READ,
    "fmi2SetReal (input)": frozenset({INITIALIZING, RUNNING, AT_EVENT, CONTINUOUS}),
    "fmi2SetReal (tunable parameter)": frozenset({FRESH, INITIALIZING, RUNNING, AT_EVENT}),
    "fmi2SetReal (fixed parameter)": frozenset({FRESH, INITIALIZING}),
    "fmi2SetReal (state)": frozenset({CONTINUOUS}),
    "fmi2SetReal (derivative)": NONE,
    "fmi2SetInteger (no variable)": frozenset({FRESH, INITIALIZING, RUNNING, AT_EVENT}),
    "fmi2SetBoolean (fixed parameter)": frozenset({FRESH, INITIALIZING}),
    "fmi2SetString (no variable)": frozenset({FRESH, INITIALIZING, RUNNING, AT_EVENT}),
    "fmi2GetFMUstate": EVERY,
    "fmi2SetFMUstate": EVERY,
    "fmi2FreeFMUstate": EVERY,
    "fmi2SerializedFMUstateSize": EVERY,
    "fmi2SerializeFMUstate": EVERY,
    "fmi2DeSerializeFMUstate": EVERY,
    "fmi2GetDirectionalDerivative": READ,
    "fmi2SetRealInputDerivatives": frozenset({FRESH, INITIALIZING, RUNNING}),
    "fmi2GetRealOutputDerivatives": frozenset({RUNNING, ENDED, FAILED}),
    "fmi2DoStep": frozenset({RUNNING}),
    "fmi2CancelStep": NONE,
    "fmi2GetStatus": frozenset({RUNNING, ENDED}),
    "fmi2GetRealStatus": frozenset({RUNNING, ENDED}),
    "fmi2GetIntegerStatus": frozenset({RUNNING, ENDED}),
    "fmi2GetBooleanStatus": frozenset({RUNNING, ENDED}),
    "fmi2GetStringStatus": frozenset({RUNNING, ENDED}),
    "fmi2EnterEventMode": frozenset({AT_EVENT, CONTINUOUS}),
    "fmi2NewDiscreteStates": frozenset({AT_EVENT}),
    "fmi2EnterContinuousTimeMode": frozenset({AT_EVENT}),
    "fmi2CompletedIntegratorStep": frozenset({CONTINUOUS}),
    "fmi2SetTime": frozenset({CONTINUOUS}),
    "fmi2SetContinuousStates": frozenset({CONTINUOUS}),
    "fmi2GetContinuousStates": READ,
    "fmi2GetDerivatives": READ,
    "fmi2GetEventIndicators": READ,
    "fmi2GetNominalsOfContinuousStates": EVERY,
}
"""The tables of sections 3.2.3 and 4.2.4 of FMI 2.0.5 with their notes, for the states that are reached."""

READING, STATUS = r"fmi2Get(Real|Integer|Boolean|String) .*", r"fmi2Get(Real|Boolean|String)?Status"

BEYOND: Sequence[tuple[str, frozenset[str], str]] = (
    (
        READING,
        frozenset({FRESH}),
        "any variable can be read before initialization, because importers show start values",
    ),
    (
        r"fmi2Get\w+ \((parameter|local variable)\)",
        frozenset({INITIALIZING}),
        "in initialization mode likewise, not only outputs and initial unknowns",
    ),
    (
        r"fmi2SetReal \(input\)",
        frozenset({FRESH}),
        "inputs can be set before initialization, because importers set all start values at once",
    ),
    (r"fmi2Terminate", frozenset({FAILED}), "a failed run can be terminated, because importers do so always"),
    (STATUS, frozenset({FAILED}), "how far a failed run came can be asked"),
    (
        r"fmi2SetReal \(state\)|fmi2SetTime",
        frozenset({AT_EVENT}),
        "states and time can be set in event mode, because CasADi's DaeBuilder never leaves it",
    ),
)
"""What is allowed beyond the standard: calls (a regular expression), states, and why."""

REFUSED: Sequence[tuple[str, frozenset[str], str]] = (
    (
        r"fmi2GetFMUstate",
        frozenset({FAILED}),
        "a failed run has no state to save, because none could go on from it",
    ),
    (
        r"fmi2GetIntegerStatus",
        frozenset({RUNNING, ENDED}),
        "nothing that could be asked for has the type fmi2Integer",
    ),
)
"""What is refused although the standard allows it, likewise."""

CO_SIMULATION_ONLY = re.compile(r"fmi2(SetRealInput|GetRealOutput|DoStep|CancelStep|Get\w*Status)")
MODEL_EXCHANGE_ONLY = re.compile(
    r"fmi2(EnterEvent|NewDiscrete|EnterContinuous|Completed|SetTime|SetContinuous|GetContinuous|GetDerivatives"
    r"|GetEvent|GetNominals)"
)


EXAMPLES: Mapping[str, tuple[str, float]] = {
    "(input)": ("d_ext[1,1]", 1.0),
    "(parameter)": ("k1", 1.0),
    "(tunable parameter)": ("k1", 1.0),
    "(fixed parameter)": ("x0[1,1]", 1.0),
    "(state)": ("x[1,1]", 1.0),
    "(output)": ("u[1,1]", 1.0),
    "(initial unknown)": ("x_star[1,1]", 1.0),
    "(derivative)": ("der(x[1,1])", 1.0),
}
"""A Real variable of each kind and a value for it."""


class Library:
    """The FMU's binary in an unpacked archive, without the checks and conversions of an importer."""

    def __init__(self, folder: Path) -> None:
        description = fmpy.read_model_description(str(folder), validate=False)
        self.folder, self.guid = folder, description.guid
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.states = len(description.derivatives)
        self.event_indicators = description.numberOfEventIndicators or 0
        self.functions = CDLL(
            str(folder / "binaries" / fmpy.platform / f"MixedOrderGame{fmpy.sharedLibraryExtension}")
        )
        self.functions.fmi2Instantiate.restype = c_void_p
        self.functions.fmi2FreeInstance.restype = None

    def instance(self, interface: str) -> Instance:
        """A new instance."""
        uri = (self.folder / "resources").as_uri().encode()
        kind = {"model exchange": 0, "co-simulation": 1}[interface]
        component = self.functions.fmi2Instantiate(b"called", kind, self.guid.encode(), uri, None, 0, 0)
        return Instance(self, interface, c_void_p(component))


class Instance:
    """An instance and the calls that are tried on it."""

    def __init__(self, library: Library, interface: str, component: c_void_p) -> None:
        self.library, self.interface, self.component = library, interface, component

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.library.functions.fmi2FreeInstance(self.component)

    def call(self, function: str, *arguments: Any) -> int:
        """The status of a call."""
        return int(getattr(self.library.functions, function)(self.component, *arguments))

    def set(self, name: str, value: float | bool) -> int:
        """Sets a Real or Boolean variable."""
        if isinstance(value, bool):
            return self.call("fmi2SetBoolean", self._reference(name), c_size_t(1), pointer(c_int(value)))
        return self.call("fmi2SetReal", self._reference(name), c_size_t(1), pointer(c_double(value)))

    def reach(self, state: str) -> None:
        """Bring a fresh instance into a state."""
        if state == FRESH:
            return
        if state == FAILED:  # x[2,1]' = 1e9 x[2,1]^2, and no control that could stop it
            self.set("dynamics_gain[2]", 1e9)
            self.set("robust", value=False)
            self.set("x0[2,1]", 4.0)
        self.perform("fmi2SetupExperiment")
        self.perform("fmi2EnterInitializationMode")
        if state == INITIALIZING:
            return
        self.perform("fmi2ExitInitializationMode")
        if state == FAILED:
            self.call("fmi2DoStep", c_double(0.0), c_double(1.0), 1)
        if state == CONTINUOUS:
            self.perform("fmi2NewDiscreteStates")
            self.perform("fmi2EnterContinuousTimeMode")
        if state == ENDED:
            self.perform("fmi2Terminate")

    def perform(self, call: str) -> int:
        """Status of a call whose arguments are fine in themselves."""
        function, _, kind = call.partition(" ")
        if function in ("fmi2GetTypesPlatform", "fmi2GetVersion"):
            text = getattr(self.library.functions, function)
            text.restype = c_char_p
            return OK if text() in (b"default", b"2.0") else 1
        if function == "fmi2FreeInstance":
            self.library.functions.fmi2FreeInstance(self.component)
            self.component = c_void_p()
            return OK
        if kind == "(no variable)":
            return self.call(function, None, c_size_t(0), None)
        if function in ("fmi2SetReal", "fmi2SetBoolean"):
            name, value = EXAMPLES[kind] if function == "fmi2SetReal" else ("robust", True)
            return self.set(name, value)
        if "FMUstate" in function:
            return self._with_state(function)
        one, real, integer = c_size_t(1), pointer(c_double()), pointer(c_int(1))
        output, disturbance = self._reference("x[1,1]"), self._reference("d_ext[1,1]")
        states, indicators = self.library.states, self.library.event_indicators
        vector = create_string_buffer(8 * max(states, indicators, 1))
        arguments: Mapping[str, tuple[Any, ...]] = {
            "fmi2SetDebugLogging": (0, c_size_t(0), None),
            "fmi2SetupExperiment": (0, c_double(0.0), c_double(0.0), 0, c_double(0.0)),
            "fmi2GetReal": (self._reference(EXAMPLES.get(kind, EXAMPLES["(output)"])[0]), one, real),
            "fmi2GetInteger": (self._reference("solver_steps"), one, integer),
            "fmi2GetBoolean": (self._reference("robust"), one, integer),
            "fmi2GetDirectionalDerivative": (output, one, disturbance, one, real, real),
            "fmi2SetRealInputDerivatives": (disturbance, one, integer, real),
            "fmi2GetRealOutputDerivatives": (output, one, integer, real),
            "fmi2DoStep": (c_double(0.0), c_double(1e-3), 1),
            "fmi2GetStatus": (0, integer),
            "fmi2GetRealStatus": (2, real),
            "fmi2GetIntegerStatus": (0, integer),
            "fmi2GetBooleanStatus": (3, integer),
            "fmi2GetStringStatus": (1, pointer(c_char_p())),
            "fmi2NewDiscreteStates": (create_string_buffer(64),),
            "fmi2CompletedIntegratorStep": (1, integer, integer),
            "fmi2SetTime": (c_double(0.0),),
            "fmi2SetContinuousStates": (vector, c_size_t(states)),
            "fmi2GetContinuousStates": (vector, c_size_t(states)),
            "fmi2GetDerivatives": (vector, c_size_t(states)),
            "fmi2GetEventIndicators": (vector, c_size_t(indicators)),
            "fmi2GetNominalsOfContinuousStates": (vector, c_size_t(states)),
        }
        if function == "fmi2SetContinuousStates":
            self.call("fmi2GetContinuousStates", vector, c_size_t(states))
        return self.call(function, *arguments.get(function, ()))

    def _reference(self, name: str) -> Any:
        return pointer(c_uint(self.library.references[name]))

    def _with_state(self, function: str) -> int:
        """A call that makes or takes a saved state, which comes from another instance as bytes."""
        state, size = c_void_p(), c_size_t()
        if function == "fmi2GetFMUstate":
            return self.call(function, pointer(state))
        with self.library.instance(self.interface) as donor:
            saved = c_void_p()
            donor.call("fmi2GetFMUstate", pointer(saved))
            donor.call("fmi2SerializedFMUstateSize", saved, pointer(size))
            data = create_string_buffer(size.value)
            donor.call("fmi2SerializeFMUstate", saved, data, size)
        made = self.call("fmi2DeSerializeFMUstate", data, size, pointer(state))
        arguments: Mapping[str, tuple[Any, ...]] = {
            "fmi2SetFMUstate": (state,),
            "fmi2FreeFMUstate": (pointer(state),),
            "fmi2SerializedFMUstateSize": (state, pointer(size)),
            "fmi2SerializeFMUstate": (state, data, size),
        }
        return self.call(function, *arguments[function]) if made == OK and function in arguments else made


def legal(library: Library, interface: str) -> dict[str, dict[str, bool]]:
    """Whether each call succeeds in each state: call -> state -> answer."""
    states = (
        (FRESH, INITIALIZING, RUNNING, ENDED, FAILED)
        if interface == "co-simulation"
        else (FRESH, INITIALIZING, AT_EVENT, CONTINUOUS, ENDED)
    )
    other = MODEL_EXCHANGE_ONLY if interface == "co-simulation" else CO_SIMULATION_ONLY
    answers: dict[str, dict[str, bool]] = {}
    for call in STANDARD:
        if other.match(call):
            continue
        for state in states:
            with library.instance(interface) as instance:
                instance.reach(state)
                answers.setdefault(call, {})[state] = instance.perform(call) == OK
    return answers


def deviations(rules: Sequence[tuple[str, frozenset[str], str]], call: str) -> frozenset[str]:
    """States in which a call deviates from the standard by these rules."""
    return NONE.union(*(states for calls, states, _ in rules if re.fullmatch(calls, call)))


def expected(call: str) -> frozenset[str]:
    """States in which a call must succeed: as in the standard, but for the deviations that are listed."""
    return (STANDARD[call] | deviations(BEYOND, call)) - deviations(REFUSED, call)


def explanation() -> str:
    """What the tables of calls say and where they deviate from the standard (Markdown)."""
    lines = [
        "## Calls and states\n",
        "Every cell of these tables, after those of FMI 2.0.5 with their notes, is found by calling the"
        " function in that state. *yes*: as in the standard; *beyond*: allowed beyond it; *refused*:"
        " fmi2Error although it would allow it; empty: fmi2Error, as in the standard.\n",
        "Allowed beyond it on purpose:\n",
        *(f"- {reason};" for *_, reason in BEYOND),
        "- in co-simulation, variables can be read after others were set and before the next step;",
        "- only a failed integration leads to the error state; other refused calls change nothing.\n",
        "Refused on purpose:\n",
        *(f"- {reason};" for *_, reason in REFUSED[:-1]),
        f"- {REFUSED[-1][-1]}.",
    ]
    return "\n".join(lines) + "\n"


def table_of_calls(library: Library, interface: str) -> str:
    """As Markdown."""
    words = {(True, True): "yes", (True, False): "beyond", (False, True): "refused", (False, False): ""}
    answers = legal(library, interface)
    states = list(next(iter(answers.values())))
    lines = [
        f"### {interface[0].upper()}{interface[1:]}\n",
        f"| call | {' | '.join(states)} |",
        "|---|" + "---|" * len(states),
    ]
    for call, row in answers.items():
        function, _, kind = call.partition(" ")
        cells = [words[fine, state in STANDARD[call]] for state, fine in row.items()]
        lines.append(f"| `{function}`{' ' + kind if kind else ''} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
