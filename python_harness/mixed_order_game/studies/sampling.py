"""The choice of a sampled design: light to import."""

from enum import StrEnum


class Sampling(StrEnum):
    """How points are drawn from ranges."""

    LATIN_HYPERCUBE = "latin-hypercube"
    SOBOL = "sobol"
