"""Sphinx's settings; `./dev docs` calls it on the folder that build.py fills."""

import re
from typing import Any

from pygments.lexers.shell import BashLexer
from pygments.lexers.special import TextLexer

from mixed_order_game import package_version

project = "mixed-order-game"
author = "the mixed-order-game authors"
version = release = package_version().partition("+")[0]
html_title = f"{project} {version}"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
myst_heading_anchors = 4
nb_execution_mode = "off"  # build.py has executed the tutorial
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"

html_theme = "furo"  # system fonts; nothing is fetched when a page is read
html_static_path = ["static"]
html_css_files = ["gallery.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False


def plain_text(_app: Any, _what: str, _name: str, _of: Any, _options: Any, lines: list[str]) -> None:
    """Docstrings are plain text but for numpydoc's sections: a star or a bar is no markup, as in |x - x*|."""
    has_sections = any(re.fullmatch(r"\s*-{3,}", line) for line in lines)
    for k, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            text = line if has_sections else line.lstrip()
            lines[k] = re.sub(r"([*|\\])", r"\\\1", text)


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_lexer("console", BashLexer)  # the pages show command lines without prompts
    app.add_lexer("csv", TextLexer)
    app.connect("autodoc-process-docstring", plain_text, priority=100)  # before Napoleon
