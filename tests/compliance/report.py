"""Tries the FMU in every tool and prints a table: `python -m tests.compliance.report [--write]`.

--write puts the table into python_harness/docs/compliance.md. Exit code 0 when no tool found anything.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from .tools import ROOT, Outcome, tools

FMU = ROOT / "build" / "fmu" / "MixedOrderGame.fmu"
PAGE = ROOT / "python_harness" / "docs" / "compliance.md"
BEGIN, END = "<!-- compliance: begin -->", "<!-- compliance: end -->"


def main(arguments: Sequence[str]) -> int:
    """Returns the exit code."""
    parser = argparse.ArgumentParser(prog="./dev compliance", description="Try the FMU in public importers.")
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.relative_to(ROOT)}")
    options = parser.parse_args(arguments)
    outcomes = []
    for tool in tools():
        outcomes.append(tool.try_on(FMU))
        last = outcomes[-1]
        print(
            f"{'ok     ' if last.fine else 'FINDING'}  {last.tool} {last.version}: {last.did}: {last.result}"
        )
    if options.write:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        PAGE.write_text(f"{before}{BEGIN}\n\n{table(outcomes)}\n{END}{after}", encoding="utf-8")
    return 0 if all(outcome.fine for outcome in outcomes) else 1


def line(outcome: Outcome) -> str:
    """As text."""
    mark = "ok     " if outcome.fine else "FINDING"
    return f"{mark}  {outcome.tool} {outcome.version}: {outcome.did}: {outcome.result}"


def table(outcomes: Sequence[Outcome]) -> str:
    """As Markdown."""
    lines = ["| tool | version | what it did | result |", "|---|---|---|---|"]
    for o in outcomes:
        result = o.result if o.fine else f"**finding**: {o.result}"
        lines.append(f"| {o.tool} | {o.version} | {o.did} | {result} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
