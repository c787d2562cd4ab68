"""The documentation hangs together: pages, links, code and command lines. Building it also runs the code."""

import importlib
import re
from pathlib import Path

import pytest

from semgp.cli.app import app

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
MARKDOWN = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)
REFERENCE = sorted((DOCS / "api").glob("*.rst"))
FRONT = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))

FENCE = re.compile(r"^(`{3,})(\S*)[^\n]*\n(.*?)^\1[ \t]*$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"(?<!`)\[[^]]*\]\((?!https?:)([^)\s]+)\)")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def blocks(page: Path, *kinds: str) -> list[str]:
    return [text for _, kind, text in FENCE.findall(page.read_text()) if kind in kinds]


def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text())


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"^#{1,6} (.+)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


def code(page: Path) -> list[str]:
    return [re.sub(r"\A(:[^\n]*\n)+", "", text) for text in blocks(page, "python", "{code-cell}")]


def commands(page: Path) -> list[str]:
    """Command lines of the tool in a page: lines of bash blocks, indented lines, and what code cells run."""
    indented = re.findall(r"^ {4}.+", prose(page), re.MULTILINE)
    lines = "\n".join([*blocks(page, "bash", "sh", "console"), *indented]).replace("\\\n", " ")
    typed = re.findall(r"^[ $]*(semgp .+)", lines, re.MULTILINE)
    ran = [line for cell in code(page) for line in re.findall(r'"(semgp [^"]+)"', cell)]
    return [re.sub(r"\s#\s.*", "", line).strip() for line in typed + ran]


def test_every_page_is_reached_from_the_index() -> None:
    found, new = set[Path](), [DOCS / "index"]
    while new:
        page = new.pop()
        found.add(page)
        source = next(p for p in (page.with_suffix(".md"), page.with_suffix(".rst")) if p.exists())
        for tree in blocks(source, "{toctree}"):
            entries = [line for line in tree.splitlines() if line and not line.startswith(":")]
            new += [page.parent / entry for entry in entries if page.parent / entry not in found]
    assert found == {path.with_suffix("") for path in (*MARKDOWN, *REFERENCE)}


@pytest.mark.parametrize("page", [*MARKDOWN, *FRONT], ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(prose(page)):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


@pytest.mark.parametrize("page", [page for page in (*MARKDOWN, *FRONT) if code(page)], ids=name)
def test_code_compiles(page: Path) -> None:
    for number, text in enumerate(code(page)):
        compile(text, f"{page.name}, block {number}", "exec")


@pytest.mark.parametrize("page", [page for page in (*MARKDOWN, *FRONT) if commands(page)], ids=name)
def test_command_lines_are_understood(page: Path) -> None:
    for command in commands(page):
        app.parse_args(command.removeprefix("semgp "), exit_on_error=False, print_error=False)


def test_public_names_are_in_the_reference() -> None:
    reference = "\n".join(path.read_text() for path in REFERENCE)
    told = set[str]()
    for directive, target, options in re.findall(r"\.\. auto(\w+):: (\S+)\n((?: +:.*\n)*)", reference + "\n"):
        if directive != "module":
            told.add(target.rpartition(".")[2])
        elif ":members:" in options:
            module = importlib.import_module(target)
            told |= set(getattr(module, "__all__", vars(module)))
    packages = [f"semgp.{path.parent.name}" for path in (ROOT / "src" / "semgp").glob("*/__init__.py")]
    for package in ["semgp", *packages]:
        public = set(getattr(importlib.import_module(package), "__all__", ()))
        assert package == "semgp.cli" or public <= told, f"{package}: {', '.join(sorted(public - told))}"


def test_every_example_has_its_page_in_the_course() -> None:
    pages = {path.stem for path in (DOCS / "course").glob("[0-9]*.md")}
    assert pages == {path.stem for path in EXAMPLES}
    assert [int(path.stem[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


def test_every_command_is_in_the_command_line_page() -> None:
    told = set(re.findall(r"^## semgp (\w+)", (DOCS / "cli.md").read_text(), re.MULTILINE))
    assert told == {command for command in app if not command.startswith("-")}
