"""Pages as the tests read them."""

import re
from pathlib import Path


def page_of(folder: Path, names: set[str]) -> str:
    """The page of a folder, after a check that it is complete."""
    page = (folder / "report.html").read_text()
    assert {path.stem for path in (folder / "figures").iterdir()} == names
    assert (
        len(re.findall(r"<figure\b", page))
        == page.count("data:image/")
        == page.count("<figcaption>")
        == len(names)
    )
    links = set(re.findall(r'(?:src|href)="(?!data:)(.*?)"', page))
    anchors = re.findall(r'<section id="(.*?)">', page)
    assert links == {f"#{anchor}" for anchor in anchors}
    assert len(anchors) == len(set(anchors)) == page.count("<section")
    assert not re.search(r"(src|href)=\"(?!data:|#)", page)
    words = words_of(page)
    assert not re.search(r"\d%|\bnan\b|\binf\b|\d{5}\.\d|\d\.\d{5}", words)
    return page


def words_of(page: str) -> str:
    """What a page says: all but its styles, its scripts and the content of its figures."""
    return re.sub(r'"data:.*?"|<(style|script)\b.*?</\1>', "", page, flags=re.DOTALL)
