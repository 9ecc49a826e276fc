"""The page of promises is what the FMU and its tests say today, and leaves no promise without a test."""

import re
from pathlib import Path

import fmpy

from tests.calls_and_states import BEYOND, REFUSED, STANDARD, Library, deviations, expected, legal
from tests.promises import BEHAVIOURS, LIMITS, flags, named, page, proofs

DOCS = Path(__file__).resolve().parents[2] / "python_harness" / "docs"


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


def test_every_call_is_legal_where_the_standard_says_so_but_for_the_listed_deviations(
    fmu: Path, tmp_path: Path
) -> None:
    library = Library(Path(fmpy.extract(str(fmu), unzipdir=tmp_path)))
    for interface in flags(fmu):
        for call, states in legal(library, interface).items():
            allowed = {state for state, fine in states.items() if fine}
            assert allowed == expected(call) & states.keys(), f"{call} by {interface}"


def test_what_is_listed_as_a_deviation_is_one() -> None:
    for call, allowed in STANDARD.items():
        assert not deviations(BEYOND, call) & allowed
        assert deviations(REFUSED, call) <= allowed
    for calls, *_ in (*BEYOND, *REFUSED):
        assert any(re.fullmatch(calls, call) for call in STANDARD), calls
