"""The page of promises is what the FMU and its tests say today, and leaves no promise without a test."""

from pathlib import Path

import fmpy

from tests.calls_and_states import STANDARD, Library, legal
from tests.promises import BEHAVIOURS, LIMITS, flags, named, page, proofs

DOCS = Path(__file__).resolve().parents[2] / "python_harness" / "docs"

REFUSED = {("fmi2GetFMUstate", "error"), ("fmi2GetDirectionalDerivative", "error")}
"""The standard allows these; but a failed integration leaves nothing whole to save or to linearize."""


def test_the_page_is_current(fmu: Path) -> None:
    assert (DOCS / "promises.md").read_text(encoding="utf-8") == page(fmu), (
        "python -m tests.promises > promises.md"
    )


def test_every_behaviour_has_tests() -> None:
    assert len(BEHAVIOURS) == 25
    assert [number for number in range(1, 26) if not named(f"Behaviour{number:02}")] == []


def test_every_flag_that_promises_something_has_tests(fmu: Path) -> None:
    for interface, values in flags(fmu).items():
        for flag, value in values.items():
            if (value == "false") == (flag in LIMITS):
                assert proofs(interface, flag) != [], flag


def test_only_known_calls_are_refused_that_the_standard_allows(fmu: Path, tmp_path: Path) -> None:
    library = Library(Path(fmpy.extract(str(fmu), unzipdir=tmp_path)))
    for interface in flags(fmu):
        refused = {
            (call, state)
            for call, states in legal(library, interface).items()
            for state, fine in states.items()
            if state in STANDARD[call] and not fine
        }
        assert refused <= REFUSED, refused - REFUSED
