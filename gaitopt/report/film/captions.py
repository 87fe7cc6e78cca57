"""Words on a picture: lengths in words, and a line at the top and the bottom."""

from __future__ import annotations

from PIL import Image, ImageDraw

from gaitopt.report.letters import font as sized


def length_text(metres: float, places: int = 1) -> str:
    """Return a length in words; `places` decimals of a millimetre where it is short."""
    if abs(metres) >= 1.0:
        text = f"{metres:.{2 * places}f} m"
    else:
        millimetres = 1e3 * metres
        text = f"{millimetres:.{0 if abs(millimetres) >= 100.0 else places}f} mm"
    return text.replace("-", "−")


def write_lines(picture: Image.Image, above: str, below: str) -> None:
    """Write one line at the top and one at the bottom of a picture, each on a light ground."""
    draw = ImageDraw.Draw(picture, "RGBA")
    lines = (above, below)
    size = max(12, picture.height // 20)
    font = sized(size)
    while size > 8 and max(draw.textlength(line, font=font) for line in lines) > picture.width - 16:
        size -= 1
        font = sized(size)
    for line, y in zip(lines, (6, picture.height - 6 - round(1.5 * size)), strict=True):
        box = (6, y, 6 + draw.textlength(line, font=font) + 8, y + round(1.5 * size))
        draw.rectangle(box, fill=(255, 255, 255, 200))
        draw.text((10, y + round(0.15 * size)), line, fill=(20, 20, 20, 255), font=font)
