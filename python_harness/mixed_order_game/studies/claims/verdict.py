"""What is said of a claim: one of four verdicts, and why in one sentence."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


class Verdict(StrEnum):
    """How a claim was judged."""

    HOLDS = "holds"
    FAILS = "fails"
    NOT_COVERED = "not covered"  # what the claim presupposes is not met, or too large to be examined
    NOT_SETTLED = "not settled"  # the runs that were allowed do not decide it


@dataclass(frozen=True)
class Claim:
    """One claim about a game and what was found."""

    name: str
    statement: str
    verdict: Verdict
    reason: str  # one sentence
    figures: Mapping[str, float] = field(default_factory=dict)  # what the reason rests on, by name
