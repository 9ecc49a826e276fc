"""What `mog analyse` prints: the verdicts, and on request one table per section and the hypotheses."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..theory.findings import Analysis, Figure
from ..theory.hypotheses import Hypothesis
from .printing import show, standard_output


def print_analysis(analysis: Analysis, console: Console | None = None, *, tables: bool = False) -> None:
    """Print the verdicts of an analysis, and the tables if wished, on stdout or the console given."""
    console = console or standard_output()
    console.print(Text(analysis.title, style="bold"))
    for verdict in analysis.verdicts:
        console.print(Text(f"- {verdict}"))
    if not tables:
        return
    for section in dict.fromkeys(row.section for row in analysis.rows):
        table = Table("figure", "value", "unit", "meaning", title=Text(section), title_justify="left")
        for row in analysis.rows:
            if row.section == section:
                unit = "" if row.unit == "1" else row.unit
                table.add_row(Text(row.name), Text(_plain(row.value)), unit, Text(row.meaning))
        show(table, console)
    if analysis.hypotheses:
        show(_hypotheses("Theorem 1 for the given gains", analysis.hypotheses), console)
    for each in analysis.demonstrations:
        show(_hypotheses(f"Theorem 1 for the design by {each.name}", each.hypotheses), console)


def _hypotheses(title: str, hypotheses: Sequence[Hypothesis]) -> Table:
    table = Table("", "hypothesis", "figures", title=Text(title), title_justify="left")
    marks = {True: Text("holds", style="green"), False: Text("fails", style="bold red"), None: Text("open")}
    for each in hypotheses:
        table.add_row(marks[each.holds], Text(each.name), Text(each.figures))
    return table


def _plain(value: Figure) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return value if isinstance(value, str) else f"{value:.5g}"
