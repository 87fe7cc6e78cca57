"""Pages as the tests read them."""

import html
import re
from pathlib import Path


def page_of(folder: Path, names: set[str]) -> str:
    """The page of a folder, after a check that it is complete."""
    page = (folder / "report.html").read_text()
    assert {path.stem for path in (folder / "figures").iterdir()} == names
    assert page.count("<figure") == page.count("<figcaption>") == len(names)
    drawn = set(re.findall(r'<svg.*?id="(.*?)-[wn]-', page))
    assert page.count('class="plot"') == page.count("<svg") / 2 >= len(drawn)
    links = set(re.findall(r'<[^>]* (?:src|href)="(?!data:)(.*?)"', re.sub(r"<svg.*?</svg>", "", page)))
    anchors = re.findall(r'<section id="(.*?)">', page)
    assert links == {f"#{anchor}" for anchor in anchors}
    assert len(anchors) == len(set(anchors)) == page.count("<section")
    assert not re.search(r"\d%|\bnan\b|\binf\b|\d{5}\.\d|\d\.\d{5}", words_of(page))
    return page


def words_of(page: str) -> str:
    """What a page says, with its alternative texts, without its scripts, styles and figures."""
    page = re.sub(r"(?s)<(script|style|svg).*?</\1>", "", page)
    texts = re.findall(r'(?:alt|aria-label)="(.*?)"', page)
    return html.unescape(" ".join([re.sub(r"<[^>]*>", " ", page), *texts]))
