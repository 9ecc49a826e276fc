"""Which function of FMI 2.0 the FMU allows in which state, found by calling each one in each state."""

from __future__ import annotations

import re
from collections.abc import Mapping
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer, pointer
from pathlib import Path
from typing import Any, Self

import fmpy

OK = 0
EXPLAINED = (
    "*yes*: as in the standard; *beyond*: allowed beyond the standard, because importers rely on it or"
    " nothing is lost; *refused*: fmi2Error although the standard would allow it; empty: fmi2Error, as in"
    " the standard.\n"
)

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

STANDARD: Mapping[str, frozenset[str]] = {
    "fmi2SetDebugLogging": EVERY,
    "fmi2SetupExperiment": frozenset({FRESH}),
    "fmi2EnterInitializationMode": frozenset({FRESH}),
    "fmi2ExitInitializationMode": frozenset({INITIALIZING}),
    "fmi2Terminate": frozenset({RUNNING, AT_EVENT, CONTINUOUS}),
    "fmi2Reset": EVERY,
    "fmi2GetReal": READ,
    "fmi2GetInteger": READ,
    "fmi2GetBoolean": READ,
    "fmi2SetReal (input)": frozenset({INITIALIZING, RUNNING, AT_EVENT, CONTINUOUS}),
    "fmi2SetReal (tunable parameter)": frozenset({FRESH, INITIALIZING, RUNNING, AT_EVENT}),
    "fmi2SetReal (fixed parameter)": frozenset({FRESH, INITIALIZING}),
    "fmi2SetBoolean (fixed parameter)": frozenset({FRESH, INITIALIZING}),
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
    "fmi2CancelStep": frozenset(),
    "fmi2GetStatus": frozenset({RUNNING, ENDED, FAILED}),
    "fmi2GetRealStatus": frozenset({RUNNING, ENDED, FAILED}),
    "fmi2GetBooleanStatus": frozenset({RUNNING, ENDED, FAILED}),
    "fmi2GetStringStatus": frozenset({RUNNING, ENDED, FAILED}),
    "fmi2EnterEventMode": frozenset({AT_EVENT, CONTINUOUS}),
    "fmi2NewDiscreteStates": frozenset({AT_EVENT}),
    "fmi2EnterContinuousTimeMode": frozenset({AT_EVENT}),
    "fmi2CompletedIntegratorStep": frozenset({CONTINUOUS}),
    "fmi2SetTime": frozenset({AT_EVENT, CONTINUOUS}),
    "fmi2SetContinuousStates": frozenset({CONTINUOUS}),
    "fmi2GetContinuousStates": READ,
    "fmi2GetDerivatives": READ - {INITIALIZING},
    "fmi2GetEventIndicators": READ,
    "fmi2GetNominalsOfContinuousStates": EVERY - {INITIALIZING},
}
"""The tables of calling sequences in FMI 2.0; an asynchronous or failed step is the state error here."""

CO_SIMULATION_ONLY = re.compile(r"fmi2(SetRealInput|GetRealOutput|DoStep|CancelStep|Get\w*Status)")
MODEL_EXCHANGE_ONLY = re.compile(
    r"fmi2(EnterEvent|NewDiscrete|EnterContinuous|Completed|SetTime|SetContinuous|GetContinuous|GetDerivatives"
    r"|GetEvent|GetNominals)"
)


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
        if function == "fmi2SetReal":
            name = {"(input)": "d_ext[1,1]", "(tunable parameter)": "k1", "(fixed parameter)": "x0[1,1]"}[
                kind
            ]
            return self.set(name, 1.0)
        if function == "fmi2SetBoolean":
            return self.set("robust", value=True)
        if "FMUstate" in function:
            return self._with_state(function)
        one, real, integer = c_size_t(1), pointer(c_double()), pointer(c_int(1))
        output, disturbance = self._reference("x[1,1]"), self._reference("d_ext[1,1]")
        states, indicators = self.library.states, self.library.event_indicators
        vector = create_string_buffer(8 * max(states, indicators, 1))
        arguments: Mapping[str, tuple[Any, ...]] = {
            "fmi2SetDebugLogging": (0, c_size_t(0), None),
            "fmi2SetupExperiment": (0, c_double(0.0), c_double(0.0), 0, c_double(0.0)),
            "fmi2GetReal": (output, one, real),
            "fmi2GetInteger": (self._reference("solver_steps"), one, integer),
            "fmi2GetBoolean": (self._reference("robust"), one, integer),
            "fmi2GetDirectionalDerivative": (output, one, disturbance, one, real, real),
            "fmi2SetRealInputDerivatives": (disturbance, one, integer, real),
            "fmi2GetRealOutputDerivatives": (output, one, integer, real),
            "fmi2DoStep": (c_double(0.0), c_double(1e-3), 1),
            "fmi2GetStatus": (0, integer),
            "fmi2GetRealStatus": (2, real),
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


def table_of_calls(library: Library, interface: str) -> str:
    """As Markdown."""
    words = {(True, True): "yes", (True, False): "beyond", (False, True): "refused", (False, False): ""}
    answers = legal(library, interface)
    states = list(next(iter(answers.values())))
    lines = [
        f"## Calls and states: {interface}\n",
        EXPLAINED,
        f"| call | {' | '.join(states)} |",
        "|---|" + "---|" * len(states),
    ]
    for call, row in answers.items():
        function, _, kind = call.partition(" ")
        cells = [words[fine, state in STANDARD[call]] for state, fine in row.items()]
        lines.append(f"| `{function}`{' ' + kind if kind else ''} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
