"""Lines of the entries of a TOML file, read from tree-sitter's concrete syntax tree."""

import tomllib
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tree_sitter import Node

Path = tuple[str | int, ...]
"""Keys and 0-based list positions; () is the file itself."""


class Positions:
    """Where each entry of a TOML file begins. The file must be valid TOML."""

    def __init__(self, text: str) -> None:
        import tree_sitter
        import tree_sitter_toml

        parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_toml.language()))
        self._lines: dict[Path, int] = {(): 1}
        self._lengths: dict[Path, int] = {}  # of arrays of tables
        self._read(parser.parse(text.encode()).root_node)

    def line(self, path: Path) -> int:
        """Line of an entry, 1-based; of what would hold it if there is no such entry."""
        while path not in self._lines:
            path = path[:-1]
        return self._lines[path]

    def _read(self, document: "Node") -> None:
        for node in document.children:
            if node.type == "pair":
                self._pair(node, ())
            elif node.type in ("table", "table_array_element"):
                keys, _ = _key_and_values(node)
                path = self._resolved(keys, new_element=node.type == "table_array_element")
                self._note(path, node)
                for pair in node.children:
                    if pair.type == "pair":
                        self._pair(pair, path)

    def _resolved(self, keys: list[str], *, new_element: bool) -> Path:
        """The path of a table's header; names of arrays of tables mean their last element."""
        path: Path = ()
        for position, key in enumerate(keys):
            path = (*path, key)
            if new_element and position == len(keys) - 1:
                self._lengths[path] = self._lengths.get(path, 0) + 1
            if path in self._lengths:
                path = (*path, self._lengths[path] - 1)
        return path

    def _pair(self, node: "Node", table: Path) -> None:
        keys, values = _key_and_values(node)
        path = (*table, *keys)
        self._note(path, node)
        for value in values:
            self._value(value, path)

    def _value(self, node: "Node", path: Path) -> None:
        if node.type == "array":
            items = (child for child in node.named_children if child.type != "comment")
            for position, item in enumerate(items):
                self._note((*path, position), item)
                self._value(item, (*path, position))
        elif node.type == "inline_table":
            for pair in node.named_children:
                if pair.type == "pair":
                    self._pair(pair, path)

    def _note(self, path: Path, node: "Node") -> None:
        """Remember an entry, and the tables that its dotted key or header implies, unless known."""
        for end in range(1, len(path) + 1):
            self._lines.setdefault(path[:end], node.start_point.row + 1)


def _key_and_values(node: "Node") -> tuple[list[str], list["Node"]]:
    """The key of a pair or of a header, and what else it holds but comments and pairs."""
    first, *rest = (child for child in node.named_children if child.type not in ("comment", "pair"))
    return list(_names(first)), rest


def _names(node: "Node") -> Iterator[str]:
    """The parts of a key: bare, quoted or dotted."""
    text = (node.text or b"").decode()
    if node.type == "dotted_key":
        for child in node.named_children:
            yield from _names(child)
    elif node.type == "quoted_key":
        yield next(iter(tomllib.loads(f"{text} = 0")))
    else:
        yield text
