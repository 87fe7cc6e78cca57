"""The packages, their imports, and the picture of both in docs/architecture.svg.

    python tests/house.py

draws the picture anew; a test holds it against the code.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "gaitopt"
PICTURE = ROOT / "docs" / "architecture.svg"

_ROW, _LEFT, _WIDTH, _TOP = 58, 20, 620, 20
_STYLE = """\
  text { font-family: system-ui, "DejaVu Sans", sans-serif; fill: #1b1f24 }
  .name { font-size: 15px; font-weight: 600 } .about { font-size: 12px; fill: #4a5058 }
  .inner { font-size: 11px; fill: #4a5058 } .box { fill: #f4f6f8; stroke: #8a929b }
  .arrow { fill: none; stroke: #4878a8; stroke-width: 1.2 } .head { fill: #4878a8 }
  .page { fill: #ffffff }"""


def rows() -> list[str]:
    """The packages from the first row to the last, as pyproject.toml orders them."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = content["tool"]["importlinter"]["contracts"]
    layers = next(c["layers"] for c in contracts if c["containers"] == ["gaitopt"])
    names = [name.strip("()") for layer in reversed(layers) for name in layer.split(" : ")]
    return [name for name in names if (PACKAGE / name).is_dir()]


def package_imports(packages: Sequence[str]) -> dict[str, set[str]]:
    """Which packages each package imports from."""
    graph = grimp.build_graph("gaitopt", cache_dir=None)
    imports: dict[str, set[str]] = {name: set() for name in packages}
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            one, other = (name.split(".")[1:2] for name in (module, imported))
            if one != other and one and other and one[0] in imports and other[0] in imports:
                imports[one[0]].add(other[0])
    return imports


def reduced(imports: Mapping[str, set[str]]) -> list[tuple[str, str]]:
    """The imports that no chain of other imports implies: importer, imported."""

    def reach(name: str) -> set[str]:
        return imports[name].union(*(reach(other) for other in imports[name]))

    return [
        (name, other)
        for name, others in imports.items()
        for other in sorted(others)
        if not any(other in reach(third) for third in others - {other})
    ]


def about(package: str) -> str:
    """First line of a package's or a file's docstring."""
    path = PACKAGE / package
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(path.read_text())) or "").partition("\n")[0]


def inner(package: str) -> str:
    """The packages inside a package."""
    folders = (path.parent.name for path in sorted((PACKAGE / package).glob("*/__init__.py")))
    return ", ".join(folders)


def picture() -> str:
    """The SVG: a box for each package, and an arrow from each to what it imports."""
    packages = rows()
    place = {name: _TOP + _ROW * index for index, name in enumerate(packages)}
    edges = reduced(package_imports(packages))
    reach = max((place[one] - place[other] for one, other in edges), default=0)
    width, height = _LEFT + _WIDTH + 40 + 0.28 * reach, _TOP + _ROW * len(packages)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height}" role="img">',
        "<title>The packages of gaitopt and their imports</title>",
        f"<style>\n{_STYLE}\n</style>",
        f'<rect class="page" width="{width:.0f}" height="{height}"/>',
        '<marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" '
        'orient="auto"><path class="head" d="M0 0 8 4 0 8z"/></marker>',
    ]
    for name, top in place.items():
        parts += [
            f'<rect class="box" x="{_LEFT}" y="{top}" width="{_WIDTH}" height="{_ROW - 14}" rx="5"/>',
            f'<text class="name" x="{_LEFT + 12}" y="{top + 19}">{name}/</text>',
            f'<text class="about" x="{_LEFT + 120}" y="{top + 19}">{escape(about(name))}</text>',
        ]
        if inner(name):
            parts.append(f'<text class="inner" x="{_LEFT + 120}" y="{top + 36}">in it: {inner(name)}</text>')
    right = _LEFT + _WIDTH
    for one, other in edges:
        begin, end = place[one] + 14, place[other] + 30
        out = right + 18 + 0.36 * (begin - end)
        parts.append(
            f'<path class="arrow" marker-end="url(#head)" '
            f'd="M{right} {begin}C{out:.0f} {begin} {out:.0f} {end} {right + 2} {end}"/>'
        )
    return "\n".join([*parts, "</svg>"]) + "\n"


if __name__ == "__main__":
    PICTURE.write_text(picture())
    print(PICTURE)
