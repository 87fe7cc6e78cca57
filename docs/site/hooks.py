"""What MkDocs builds beside `docs/`: README, records and notebooks of the repository, each where it lies.

Links between them stay as they are written, for readers of the repository. They become links of the site;
a file that a page links to is copied beside it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from posixpath import relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
RENAMED = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages of the repository's root, by their names on the site."""

_LINK = re.compile(r"(?<=\]\()(?!\w+:|#)([^)\s#]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what lies outside of `docs/` and is a page, or is linked to by one; and the notebooks as pages."""
    for notebook in sorted(Path(config.docs_dir).glob("*.ipynb")):
        files.append(File.generated(config, f"{notebook.stem}.md", content=notebook_page(notebook)))
    pages = [*(ROOT / name for name in RENAMED), *sorted(ROOT.glob("results/*/README.md"))]
    waiting = [*pages, *sorted(Path(config.docs_dir).glob("*.md"))]
    for path in waiting:
        if files.get_file_from_path(site_path(path)) is None:
            files.append(File.generated(config, site_path(path), abs_src_path=str(path)))
        if path.suffix == ".md":
            waiting += [other for other in linked(path) if other not in waiting]
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links between files of the site."""
    place = Path(page.file.abs_src_path or config.docs_dir).parent

    def on_this_site(link: re.Match[str]) -> str:
        target = file_of(place / link[1])
        return relpath(site_path(target), str(Path(page.file.src_uri).parent)) if target else link[1]

    return _LINK.sub(on_this_site, markdown)


def linked(page: Path) -> Iterator[Path]:
    """Yield the files of the repository that a page links to."""
    for link in _LINK.findall(page.read_text("utf-8")):
        if target := file_of(page.parent / link):
            yield target


def file_of(path: Path) -> Path | None:
    """Return the file that a link leads to, of a folder its README; None where there is none."""
    path = Path(os.path.normpath(path))
    path = path / "README.md" if path.is_dir() else path
    return path if path.is_file() and ROOT in path.parents else None


def site_path(path: Path) -> str:
    """Return the place of a file of the repository on the site."""
    name = path.relative_to(ROOT).as_posix()
    return RENAMED.get(name, name.removeprefix("docs/"))


def notebook_page(path: Path) -> str:
    """Return the cells of a notebook as Markdown, with a link to the notebook itself."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    texts = ["".join(cell["source"]) for cell in cells]
    fenced = [
        f"```python\n{text}\n```" if cell["cell_type"] == "code" else text
        for cell, text in zip(cells, texts, strict=True)
    ]
    about = f"This page is a notebook: [{path.name}]({path.name}), to be run in Jupyter."
    return "\n\n".join([fenced[0], about, *fenced[1:]]) + "\n"
