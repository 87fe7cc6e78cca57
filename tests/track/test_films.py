"""Films: their own time stamps, upright pictures, and one line for what is no film."""

import os
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.track.film import facts_of, pictures


def film(path: Path, stamps_ms: list[int], options: dict[str, str] | None = None) -> Path:
    """A film whose pictures get brighter, with a white corner at the top left."""
    with av.open(str(path), "w", options=options or {}) as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "10"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for index, stamp in enumerate(stamps_ms):
            array = np.full((48, 64, 3), 3 * index, np.uint8)
            array[:16, :16] = 255
            frame = av.VideoFrame.from_ndarray(array, format="rgb24")
            frame.pts, frame.time_base = stamp, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def said(path: Path) -> str:
    with pytest.raises(GaitoptError) as error:
        list(pictures(path))
    assert "\n" not in str(error.value)
    return str(error.value).removeprefix(f"{path}: ")


def test_time_stamps_are_the_films_own() -> None:
    stamps = [100, 133, 170, 200, 251, 280, 333, 360, 400, 433]
    read = list(pictures(film(Path("varying.mp4"), stamps)))
    assert [at for at, _ in read] == pytest.approx([(s - 100) / 1000 for s in stamps], abs=2e-4)
    brightness = [float(picture[40, 40]) for _, picture in read]
    assert brightness == sorted(brightness)
    assert read[0][1].shape == (48, 64)


def test_a_film_says_how_many_pictures_it_has() -> None:
    facts = facts_of(film(Path("short.mp4"), [33 * i for i in range(12)]))
    assert facts.frames == 12
    assert facts.seconds == pytest.approx(0.4, abs=0.05)


@pytest.mark.parametrize(
    ("degrees", "corner"), [(90, "lower left"), (-90, "upper right"), (180, "lower right")]
)
def test_pictures_are_turned_as_the_film_says(degrees: int, corner: str) -> None:
    path = film(Path("upright.mp4"), [33 * i for i in range(10)])
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 40  # the matrix of a track header, version 0
    c, s = {90: (0, -1), -90: (0, 1), 180: (-1, 0)}[degrees]
    for index, value in ((0, c), (1, s), (3, -s), (4, c)):
        data[at + 4 * index : at + 4 * index + 4] = (value * 65536).to_bytes(4, "big", signed=True)
    Path("turned.mp4").write_bytes(data)
    _, picture = next(iter(pictures(Path("turned.mp4"))))
    rows = {"upper": slice(0, 8), "lower": slice(-8, None)}
    columns = {"left": slice(0, 8), "right": slice(-8, None)}
    high, side = corner.split()
    assert picture.shape == ((48, 64) if degrees == 180 else (64, 48))
    assert picture[rows[high], columns[side]].mean() > 200


def test_what_is_no_film_is_one_line() -> None:
    Path("text.mp4").write_text("no film")
    assert said(Path("text.mp4")) == "not a film that can be read, or one whose copying was cut off"
    assert said(Path("missing.mp4")) == "cannot be read: No such file or directory"
    Path("folder.mp4").mkdir()
    assert "allowed: a film" in said(Path("folder.mp4"))
    os.mkfifo("pipe.mp4")
    assert "allowed: a film" in said(Path("pipe.mp4"))


def test_a_playlist_opens_no_other_file() -> None:
    film(Path("other.mp4"), [33 * i for i in range(12)])
    Path("list.m3u8").write_text("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nother.mp4\n#EXT-X-ENDLIST\n")
    Path("list.txt").write_text("ffconcat version 1.0\nfile other.mp4\n")
    for name in ("list.m3u8", "list.txt"):
        assert said(Path(name)).startswith("not a film")


def test_a_film_that_was_cut_off_is_one_line() -> None:
    whole = film(Path("whole.mp4"), [33 * i for i in range(60)]).read_bytes()
    Path("no_end.mp4").write_bytes(whole[: len(whole) // 2])
    assert said(Path("no_end.mp4")) == "not a film that can be read, or one whose copying was cut off"
    started = film(Path("started.mp4"), [33 * i for i in range(60)], {"movflags": "faststart"}).read_bytes()
    begin = started.index(b"mdat")
    Path("half.mp4").write_bytes(started[: begin + (len(started) - begin) // 2])
    line = said(Path("half.mp4"))
    assert line.startswith("the film ends in the middle, after ")
    assert line.endswith("s of 1.98 s; copy it again")
