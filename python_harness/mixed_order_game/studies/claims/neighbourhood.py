"""The claim that the actions settle within a neighbourhood that the user names."""

from .verdict import Claim, Verdict


def within_neighbourhood(actions: Claim, wanted: float) -> Claim:
    """Judged on the settled actions; what has not settled, or is not covered, is neither within nor outside.

    actions: the claim of practical convergence about them. wanted: largest |x - x*|.
    """
    statement = f"Settled actions stay within {wanted:g} of x*"
    if actions.verdict is not Verdict.HOLDS:
        return Claim("neighbourhood", statement, actions.verdict, actions.reason)
    largest = actions.figures["largest"]
    verdict = Verdict.HOLDS if largest <= wanted else Verdict.FAILS
    figures = {"largest": largest, "wanted": wanted}
    return Claim("neighbourhood", statement, verdict, f"The largest |x - x*| is {largest:.4g}.", figures)
