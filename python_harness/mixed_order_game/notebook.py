"""How results show themselves in a notebook: plain HTML in the notebook's own colours, without scripts."""

from collections.abc import Iterable, Sequence
from html import escape


def page(title: str, *parts: str) -> str:
    """A heading and what stands below it; the parts are HTML."""
    return f"<div><p><strong>{escape(title)}</strong></p>{''.join(parts)}</div>"


def paragraph(text: str) -> str:
    """A paragraph."""
    return f"<p>{escape(text)}</p>"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts."""
    left = "text-align:left;vertical-align:top"
    head = "".join(f'<th style="{left}">{escape(cell)}</th>' for cell in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="{left}">{escape(cell)}</td>' for cell in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def listed(texts: Iterable[str]) -> str:
    """A list of sentences."""
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"


def folded(summary: str, content: str) -> str:
    """HTML that the reader unfolds."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def digits(value: float) -> str:
    """Four digits, yes or no; a dash for what is not known."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "-" if value != value else f"{value:.4g}"  # noqa: PLR0124 - NaN alone differs from itself
