"""Pictures in, a film file out: MP4, GIF or WebP."""

from __future__ import annotations

import io
from collections.abc import Generator, Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image


def write_mp4(path: Path, pictures: Iterable[Image.Image], fps: float) -> None:
    """Write an H.264 film that browsers play.

    Args:
        path: where to.
        pictures: pictures of one size; an odd last row or column is cut off, as H.264 needs even sizes.
        fps: pictures per second, rounded to a whole number.
    """
    import av

    with av.open(path, "w", format="mp4", options={"movflags": "faststart"}) as container:
        options = {"crf": "23", "preset": "fast"}
        stream = container.add_stream("libx264", rate=round(fps), options=options)
        stream.pix_fmt = "yuv420p"
        for index, picture in enumerate(pictures):
            if index == 0:
                stream.width, stream.height = (side - side % 2 for side in picture.size)
            frame = av.VideoFrame.from_ndarray(np.asarray(picture), format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, round(fps))
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def first_picture(path: Path) -> tuple[bytes, float]:
    """Return the first picture of an MP4 file as a WebP, and its pictures per second."""
    import av

    with av.open(path) as container:
        stream = container.streams.video[0]
        fps = float(stream.average_rate or 0.0)
        first = next(container.decode(stream)).to_ndarray(format="rgb24")
    poster = io.BytesIO()
    Image.fromarray(first).save(poster, format="WEBP", quality=60)
    return poster.getvalue(), fps


def write_loop(path: Path, pictures: Iterable[Image.Image], fps: float) -> None:
    """Write a GIF or a WebP, by the suffix, that repeats without end.

    Args:
        path: where to; its suffix is ``.gif`` or ``.webp``.
        pictures: pictures of one size.
        fps: pictures per second; each is shown for a whole number of milliseconds.
    """
    look = {"duration": round(1000 / fps), "loop": 0, "save_all": True}
    if path.suffix.lower() == ".gif":
        first, *others = _with_one_palette(pictures)
        first.save(path, format="GIF", append_images=others, optimize=True, **look)
    else:
        first, *others = pictures
        first.save(path, format="WEBP", append_images=others, quality=45, method=4, **look)


def _with_one_palette(pictures: Iterable[Image.Image]) -> Generator[Image.Image]:
    """Yield pictures in the 64 colours of the first, without dithering, so that still parts cost nothing."""
    palette: Image.Image | None = None
    for picture in pictures:
        palette = palette or picture.quantize(64, dither=Image.Dither.NONE)
        yield picture.quantize(palette=palette, dither=Image.Dither.NONE)
