"""Integrates by CVODES through CasADi: `python daebuilder_integrate.py FMU STOP INTERVALS CSV VARIABLE...`.

The Jacobian that CVODES uses comes from the FMU's directional derivatives; it is compared with differences of
the rates first. The variables are states, written at the start and after every interval.
"""

import sys
import tempfile
import zipfile
from pathlib import Path

import casadi as ca
import numpy as np


def main() -> None:
    fmu, stop, intervals, csv, *names = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        dae = ca.DaeBuilder("game", folder)
        rates = dae.create("rates", ["t", "x", "u"], ["ode"])
        start = [initial(dae, name) for name in dae.x()]
        check_jacobian(rates, np.array(start))
        t, x, u = (ca.MX.sym(name, rates.size1_in(k)) for k, name in enumerate("txu"))
        times = np.linspace(0.0, float(stop), int(intervals) + 1)
        options = {"reltol": 1e-9, "abstol": 1e-11, "max_num_steps": 100_000}
        equations = {"t": t, "x": x, "u": u, "ode": rates(t, x, u)}
        run = ca.integrator("run", "cvodes", equations, 0.0, times[1:], options)
        states = np.column_stack([start, np.array(run(x0=start)["xf"])])
    columns = [times, *(states[dae.x().index(name)] for name in names)]
    rows = (map(repr, map(float, row)) for row in zip(*columns, strict=True))
    lines = [";".join(row) for row in (["time", *names], *rows)]
    Path(csv).write_text("\n".join(lines) + "\n", encoding="utf-8")


def initial(dae: ca.DaeBuilder, state: str) -> float:
    """x[i,l] starts at the parameter x0[i,l], and so on; weights start at zero."""
    stem, _, index = state.partition("[")
    return 0.0 if stem == "W" else float(dae.start(f"{stem}0[{index}")[0])


def check_jacobian(rates: ca.Function, state: np.ndarray) -> None:
    """Ends the program if the Jacobian differs from central differences."""
    still = np.zeros(rates.size1_in(2))
    exact = np.array(ca.DM(rates.jacobian()(0.3, state, still, 0.0)[1]))
    h = 1e-6
    differences = np.column_stack(
        [
            np.array(rates(0.3, state + h * e, still) - rates(0.3, state - h * e, still)).ravel() / (2.0 * h)
            for e in np.eye(len(state))
        ]
    )
    error = np.abs(exact - differences).max() / np.abs(exact).max()
    if not error < 1e-7:
        sys.exit(f"the Jacobian differs from differences by {error:.1e} of its largest entry")


if __name__ == "__main__":
    main()
