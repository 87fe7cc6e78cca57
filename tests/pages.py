"""Pages as the tests read them."""

import html
import math
import re
from collections.abc import Iterator
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


_NUMBER = re.compile(r"(?<![\w.-])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w-]|\.\d)")
"""A number that is no part of a name such as ``square-1s``."""

_FACTORS = (1.0, 1e3, 1e2, math.degrees(1.0))
"""From SI units to those that readers see: mm and ms, per cent, degrees."""


def tables_of(page: str) -> dict[str, list[list[str]]]:
    """The cells of each table of a page, under its title, without its head."""
    found = {}
    for table in re.findall(r"(?s)<table>(.*?)</table>", page):
        (title,) = re.findall(r"(?s)<caption.*?>(.*?)</caption>", table)
        rows = re.findall(r"(?s)<tr.*?>(.*?)</tr>", table.partition("<tbody>")[2])
        cells = [re.findall(r"(?s)<t[hd].*?>(.*?)</t[hd]>", row) for row in rows]
        found[words_of(title)] = [[_plain(words_of(cell)) for cell in row] for row in cells]
    return found


def tiles_of(page: str) -> list[str]:
    """The figures in the tiles of a page."""
    return [_plain(words_of(one)) for one in re.findall(r"(?s)<div><b>(.*?)</b>", page)]


def foreign_numbers(texts: list[str], content: object) -> list[str]:
    """The numbers in texts that are those of a JSON file in no unit, rounded as the text is."""
    known = list(_numbers(content))
    return [
        text
        for text in (found for one in texts for found in _NUMBER.findall(_plain(one)))
        if not any(_rounds_to(value * factor, text) for value in known for factor in _FACTORS)
    ]


def _plain(text: str) -> str:
    return text.replace("\u00a0", " ").replace("−", "-").strip()


def _numbers(content: object) -> Iterator[float]:
    """The numbers of a JSON file, and how many entries its lists have."""
    if isinstance(content, dict):
        for value in content.values():
            yield from _numbers(value)
    elif isinstance(content, list):
        yield len(content)
        for value in content:
            yield from _numbers(value)
    elif isinstance(content, (int, float)):
        yield content
    elif isinstance(content, str):
        yield from map(float, _NUMBER.findall(content))


def _rounds_to(value: float, text: str) -> bool:
    mantissa, _, exponent = text.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(value - float(text)) <= 0.5 * last * (1.0 + 1e-9)
