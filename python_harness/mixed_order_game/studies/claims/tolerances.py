"""Relative tolerances of the runs that claims are judged on; the absolute one is a hundredth of each."""

TOLERANCE = 1e-8
"""Of robust and perturbed runs."""

PLAIN_TOLERANCE = 1e-10
"""Of unperturbed runs without the robust part, which are compared with the exact solution."""
