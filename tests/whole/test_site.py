"""README and documentation site: short, whole, without network, legible on a phone and in the dark."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import browser_tab, needs_browser

import gaitopt

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
LOADED = {"script": "src", "img": "src", "iframe": "src", "link": "href", "video": "src", "source": "src"}
"""What a browser loads by itself, and where it is named."""

needs_mkdocs = pytest.mark.skipif(find_spec("mkdocs") is None, reason="no mkdocs: pip install '.[docs]'")


class Html(HTMLParser):
    """A page: its links, what it loads, and its anchors."""

    def __init__(self, path: Path):
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors = {""}
        self.feed(path.read_text("utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = {key: value or "" for key, value in attrs}
        self.anchors.add(named.get("id", ""))
        if tag == "a" and "href" in named:
            self.links.append(named["href"])
        if tag in LOADED and LOADED[tag] in named and named.get("rel") != "canonical":
            self.loaded.append(named[LOADED[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built strictly: a page or a link that MkDocs does not find is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def sentences(text: str) -> Iterator[str]:
    """The sentences of a Markdown page, its tables' cells among them; code is left out."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    text = re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", text)  # links and pictures
    for paragraph in re.split(r"\n\s*\n|\n(?=[-|#\d])|\|", text):
        yield from re.split(r"(?<=[.:?!])\s+", " ".join(paragraph.split()))


def test_no_sentence_of_the_readme_has_more_than_30_words() -> None:
    found = list(sentences(README))
    assert len(found) > 30
    assert [one for one in found if len(one.split()) > 30] == []


def test_the_readme_fits_two_screens() -> None:
    assert len(README.splitlines()) <= 80
    assert max(map(len, README.splitlines())) <= 220  # a row of a table


def test_the_readme_says_which_python_and_how_to_get_the_source() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    assert f"Python {wanted.removeprefix('>=')} or later" in README
    assert README.index("git clone") < README.index("pip install")


@pytest.mark.slow
@needs_mkdocs
def test_every_link_of_the_site_leads_somewhere_and_nothing_comes_from_the_network(site: Path) -> None:
    pages = {path: Html(path) for path in sorted(site.rglob("*.html"))}
    assert len(pages) > 40
    wrong = []
    for path, page in pages.items():
        if path.name == "404.html":  # a server shows it at any address
            continue
        for link in page.links + page.loaded:
            parts = urlsplit(link)
            if parts.scheme in ("http", "https", "mailto") and link not in page.loaded:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if parts.scheme or parts.netloc or not target.is_file():
                wrong.append(f"{path.relative_to(site)}: {link}")
            elif target in pages and unquote(parts.fragment) not in pages[target].anchors | {"__top"}:
                wrong.append(f"{path.relative_to(site)}: no such place: {link}")
    assert wrong == []


@pytest.mark.slow
@needs_mkdocs
def test_the_reference_has_every_public_name_with_its_docstring(site: Path) -> None:
    page = (ROOT / "docs" / "reference.md").read_text()
    named = re.findall(r"^::: (\S+)$", page, flags=re.M)
    assert sorted(name.rpartition(".")[2] for name in named) == sorted(gaitopt.__all__)
    assert set(named) <= Html(site / "reference.html").anchors


@pytest.mark.slow
@needs_mkdocs
@needs_browser
def test_the_site_is_legible_on_a_phone_and_in_the_dark_and_searches_without_a_server(site: Path) -> None:
    with browser_tab() as tab:
        for name in ("index.html", "reference.html", "guarantees.html", "results/blind/index.html"):
            for width in (390, 1280):
                tab.opened(site / name, width=width)
                assert tab.value("document.documentElement.scrollWidth") <= width, name
        shades = []
        for theme in ("light", "dark"):
            tab.opened(site / "index.html", prefers_color_scheme=theme)
            shades.append(tab.screenshot().convert("L").resize((1, 1)).getpixel((0, 0)))
        assert shades[0] > 200
        assert shades[1] < 80
        tab.value(
            """new Promise((found) => {
              const query = document.querySelector("[data-md-component=search-query]");
              const result = document.querySelector(".md-search-result__list");
              const watching = new MutationObserver(() => result.children.length && found());
              watching.observe(result, { childList: true });
              query.focus();
              query.value = "posterior";
              query.dispatchEvent(new Event("keyup", { bubbles: true }));
            })"""
        )
        assert "posterior" in tab.value("document.querySelector('.md-search-result__list').innerText")
        assert tab.messages == []
