"""Sweeps: many runs of one FMU over grids, sampled designs, graphs and random initial states.

>>> from mixed_order_game.studies.sweep.conduct import sweep
>>> from mixed_order_game.studies.sweep.definition import Sweep
>>> result = sweep(Sweep(fmu, grid={"k1": (5.0, 10.0, 20.0)}), "gains")
>>> result["settling_time"]
"""

from ...extras import need

need("pyarrow")  # rows are kept as Parquet
