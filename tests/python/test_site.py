"""The site of the documentation: what can be judged without building it."""

import re
from importlib import import_module
from pathlib import Path

import pytest

build = import_module("python_harness.docs.site.build")  # to mypy, docs.site.build is another module
gallery = import_module("python_harness.docs.site.gallery")
PAGES: dict[Path, str] = build.PAGES
GENERATED = {"gallery/index", "command_reference", "python_reference"}


def test_every_page_has_a_place() -> None:
    home = (build.SITE / "index.md").read_text(encoding="utf-8")
    trees = re.findall(r"^```\{toctree\}\n(?::.*\n)*\n((?:\w.*\n)*)```", home, re.MULTILINE)
    placed = [line for tree in trees for line in tree.splitlines()]
    pages = {name.rpartition(".")[0] for name in PAGES.values()} - {"index"}
    assert sorted(placed) == sorted(pages | GENERATED)


@pytest.mark.parametrize("page", [page for page in PAGES if page.suffix == ".md"], ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", build.relinked(page), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        if ":" in target:
            continue
        made = target in PAGES.values() or target.startswith("gallery/")
        assert made or (build.STAGE / target).resolve().is_file() or (build.DOCS / target).is_file(), target


def test_links_follow_the_pages() -> None:
    contributing = build.relinked(build.ROOT / "CONTRIBUTING.md")
    for target in ("architecture.md", "notation.md", "../../core/families/cost.hpp"):
        assert f"]({target})" in contributing
    assert "](gallery/five_vehicles.md)" in build.relinked(build.DOCS / "games.md")


def test_the_head_of_a_game_file_becomes_prose() -> None:
    head, rest = gallery.split("# One.\n#\n#     f_i = x_i*y\n#\n# Then x* <= 1.\ntitle = 'T'\n")
    assert rest == "title = 'T'\n"
    assert gallery.prose(head) == "One.\n\n    f_i = x_i*y\n\nThen x\\* \\<= 1."
