"""Builds the documentation as a site that needs no network: `./dev docs`.

The pages are those of python_harness/docs, CONTRIBUTING.md, CHANGELOG.md and core/notation.md; their links
are led to where the pages lie in the site. The tutorial is executed, the gallery drawn, the references of
commands and Python are made from the package. Whatever Sphinx warns of, links that lead nowhere included, is
an error.
"""

import os
import re
import shutil
import subprocess
import sys
from inspect import isclass
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from traitlets.config import Config

import mixed_order_game

from .gallery import write_gallery

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "python_harness" / "docs"
SITE = DOCS / "site"
OUTPUT = ROOT / "build" / "docs"
STAGE = ROOT / "build" / "docs_source"

PAGES = {
    **{page: page.name for page in sorted(DOCS.glob("*.md"))},
    SITE / "index.md": "index.md",
    DOCS / "tutorial.ipynb": "tutorial.ipynb",
    ROOT / "CONTRIBUTING.md": "contributing.md",
    ROOT / "CHANGELOG.md": "changelog.md",
    ROOT / "core" / "notation.md": "notation.md",
}
"""Pages of the project, and their names in the site."""


def main() -> int:
    """Return the exit code."""
    for folder in (STAGE, OUTPUT):
        shutil.rmtree(folder, ignore_errors=True)
    STAGE.mkdir(parents=True)
    for page, name in PAGES.items():
        if page.suffix == ".md":
            (STAGE / name).write_text(relinked(page), encoding="utf-8")
    shutil.copytree(DOCS / "images", STAGE / "images")
    for picture in DOCS.glob("*.png"):
        shutil.copy(picture, STAGE)
    say("Executing the tutorial")
    execute(DOCS / "tutorial.ipynb", STAGE / "tutorial.ipynb")
    say("Drawing the gallery")
    write_gallery(STAGE / "gallery")
    (STAGE / "python_reference.md").write_text(python_reference(), encoding="utf-8")
    write_command_reference(STAGE / "command_reference.md")
    say("Sphinx")
    options = ["-b", "html", "-c", str(SITE), "-W", "--keep-going", "-q"]
    done = subprocess.run([sys.executable, "-m", "sphinx", *options, STAGE, OUTPUT], check=False)
    if done.returncode == 0:
        say(f"{OUTPUT.relative_to(ROOT)}/index.html")
    return done.returncode


def say(text: str) -> None:
    """Tell the user."""
    sys.stderr.write(text + "\n")


def relinked(page: Path) -> str:
    """The text of a page; its links lead to pages of the site, to the gallery, to files of the project."""

    def led(link: re.Match[str]) -> str:
        target = (page.parent / link["path"]).resolve()
        if page.parent == SITE or ":" in link["path"] or not target.is_relative_to(ROOT):
            return link[0]
        if target in PAGES:
            path = PAGES[target]
        elif target.parent.name == "games" and target.suffix == ".toml":
            path = f"gallery/{target.stem}.md"
        elif target.parent in (DOCS, DOCS / "images"):
            return link[0]
        else:
            path = os.path.relpath(target, STAGE)
        return f"]({path}{link['anchor']})"

    parts = re.split(r"(^```.*?^```)", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    parts[::2] = [
        re.sub(r"\]\((?P<path>[^)#\s]+)(?P<anchor>(?:#[^)\s]*)?)\)", led, text) for text in parts[::2]
    ]
    return "".join(parts)


def execute(notebook: Path, output: Path) -> None:
    """Run a notebook from its first cell to its last and write it with its outputs."""
    cells = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call]
    ipc = {"KernelManager": {"transport": "ipc"}}  # over TCP the kernel warns of those who listen
    NotebookClient(cells, timeout=300, kernel_name="python3", config=Config(ipc)).execute()
    nbformat.write(cells, output)  # type: ignore[no-untyped-call]


def write_command_reference(page: Path) -> None:
    """Every command with its options, by Typer's own generator."""
    words = ["mixed_order_game.cli.app", "utils", "docs", "--name", "mog", "--title", "Command reference"]
    typer = Path(sys.executable).parent / "typer"
    subprocess.run([typer, *words, "--output", page], check=True, stdout=subprocess.DEVNULL)


def python_reference() -> str:
    """A page of directives that take signatures and docstrings from the package."""
    kinds: dict[str, list[str]] = {"Functions": [], "Classes": [], "Errors": []}
    for name in sorted(dir(mixed_order_game), key=str.lower):
        thing = getattr(mixed_order_game, name)
        if isclass(thing):
            kind = "Errors" if issubclass(thing, Exception) else "Classes"
            members = "" if kind == "Errors" else "\n   :members:"
            kinds[kind].append(f".. autoclass:: mixed_order_game.{name}{members}")
        elif callable(thing):
            kinds["Functions"].append(f".. autofunction:: mixed_order_game.{name}")
    lines = ["# Python reference", "", "[The guide](python.md) shows how these work together.", ""]
    plot = [".. automodule:: mixed_order_game.results.plot\n   :members:"]
    for kind, directives in [*kinds.items(), ("Figures", plot)]:
        lines += [f"## {kind}", "", "```{eval-rst}", *(f"{text}\n" for text in directives), "```", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
