"""Settings of pages, figures and films that no option of the command line sets."""

from __future__ import annotations

from dataclasses import dataclass

FILM, PAGE = "film", "page"
"""Names of stages of a job."""


@dataclass(frozen=True)
class FilmSettings:
    """How films look.

    An MP4 plays once; a GIF or WebP repeats without end, and compresses less well. So these have smaller
    pictures, and only as many as the motion needs.

    Attributes:
        size: width and height of one robot's picture in an MP4, pixels.
        fps: pictures per second of an MP4.
        loop_size: width and height of one robot's picture in a GIF or WebP, pixels.
        loop_rates: rates that a GIF or WebP may have, pictures per second, rising.
        pictures_per_cycle: fewest pictures of a cycle that still show the motion.
        min_s: a film shows whole cycles that last at least this long, s.
        field_of_view_deg: vertical field of view of the camera.
        elevation_deg: low enough to see pads lift, high enough that the ground fills the picture.
        side_deg: angle between the camera and the robot's own side view.
        margin: picture size over the size of what must be in it.
        trail_s: how long the trail of a measured marker is, s.
        trail_points: most spheres in such a trail.
        ghost_reach: a measured marker far from the robot widens the picture by at most this factor.
    """

    size: tuple[int, int] = (640, 360)
    fps: float = 25.0
    loop_size: tuple[int, int] = (400, 226)
    loop_rates: tuple[float, ...] = (10.0, 12.5, 20.0, 25.0)
    pictures_per_cycle: float = 6.0
    min_s: float = 5.0
    field_of_view_deg: float = 30.0
    elevation_deg: float = -22.0
    side_deg: float = 15.0
    margin: float = 1.3
    trail_s: float = 1.0
    trail_points: int = 30
    ghost_reach: float = 1.5


@dataclass(frozen=True)
class PlayerSettings:
    """How much of a motion a page holds. A page stays below 5 MB with figures and a film.

    Attributes:
        rate_hz: poses per second; the player interpolates.
        least_rate_hz: where poses take too many bytes, there are fewer per second, but at least so many;
            then less time is kept.
        pose_bytes: bytes of the poses of all gaits on a page; text makes a third more of them.
        mesh_bytes: bytes of the meshes of one robot; where there are more, the meshes are made coarser.
        most_shown: most gaits on a page.
    """

    rate_hz: float = 60.0
    least_rate_hz: float = 20.0
    pose_bytes: int = 1_200_000
    mesh_bytes: int = 500_000
    most_shown: int = 8


@dataclass(frozen=True)
class ReportSettings:
    """How pages look.

    Attributes:
        dpi: pixels per inch of a figure. A figure is 6 inches wide: 240 is enough for print.
        film_s: a film on a page shows whole cycles, one at least, that last about this long, s.
        film: how films look.
        player: how much of a motion a page holds.
    """

    dpi: int = 240
    film_s: float = 3.0
    film: FilmSettings = FilmSettings()
    player: PlayerSettings = PlayerSettings()


DEFAULT = ReportSettings()
"""What pages, figures and films use where no settings are given.

This is the hook for tests that drive the command line: they set it to smaller pictures.
"""
