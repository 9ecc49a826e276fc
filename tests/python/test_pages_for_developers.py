"""CONTRIBUTING.md, the page on the architecture and CITATION.cff: what they name exists."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python_harness" / "mixed_order_game"
PAGES = [ROOT / "CONTRIBUTING.md", ROOT / "python_harness" / "docs" / "architecture.md"]
SOURCES = [".cpp", ".hpp", ".ipp", ".py"]

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def quoted(page: Path) -> list[str]:
    """What stands in backquotes, outside of blocks."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.findall(r"`([^`]+)`", text)


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).lower().replace(" ", "-") for heading in headings}


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]*)(?:#([^)]*))?\)", page.read_text(encoding="utf-8"))
    assert links
    for target, anchor in links:
        path = page.parent / target if target else page
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), anchor


@each_page
def test_named_files_and_folders_exist(page: Path) -> None:
    named = [
        name for name in quoted(page) if re.fullmatch(r"[\w/*.]+/|[\w/*]*\w\.(cpp|hpp|py|md|txt|map)", name)
    ]
    assert len(named) > 10
    not_yet = {"core/families/my_cost.hpp", "fmu_src/fmi3"}
    for name in set(named) - not_yet:
        folders = (ROOT, page.parent, PACKAGE, PACKAGE.parent, ROOT / "core" / "loop")
        assert any(any(folder.glob(name)) for folder in folders), name


@each_page
def test_named_commands_of_dev_exist(page: Path) -> None:
    usage = (ROOT / "dev").read_text(encoding="utf-8")
    for command in re.findall(r"\./dev ([a-z]\w*)", page.read_text(encoding="utf-8")):
        assert re.search(rf"^  {command}\b", usage, re.MULTILINE), command


@each_page
def test_named_functions_and_types_exist(page: Path) -> None:
    folders = ("core", "fmu_src", "modelDescription", "python_harness", "tests")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in SOURCES]
    words = set(re.findall(r"\w+", " ".join(path.read_text(encoding="utf-8") for path in paths)))
    general = {"UpperCamelCase", "snake_case", "fmpy", "mog", "console"}
    for name in quoted(page):
        if re.fullmatch(r"\w+(::\w+)*", name) and name not in general:
            assert set(name.split("::")) <= words, name


def test_the_citation_is_of_this_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, version = settings["project"], settings["tool"]["setuptools_scm"]["fallback_version"]
    assert f"\ntitle: {project['name']}\nabstract: >-\n  {project['description']}" in citation
    assert f"\nversion: {version}\nlicense: {project['license']}\n" in citation
    paper = re.search(r"^  - type: article\n    title: >-\n      (.*)\n", citation, re.MULTILINE)
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert paper is not None
    assert f"*{paper[1]}*" in readme


def test_a_step_of_dev_that_fails_ends_it() -> None:
    """In a list of && or || the shell goes on inside a function after an error."""
    text = (ROOT / "dev").read_text(encoding="utf-8")
    functions = re.findall(r"^(\w+)\(\) \{", text, re.MULTILINE)
    assert "build" in functions
    for line in text.splitlines():
        assert not re.search(rf"(?:^|[;)] )\s*(?:{'|'.join(functions)})\b[^;]*(?:&&|\|\|)", line), line
