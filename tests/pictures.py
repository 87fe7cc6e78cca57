"""Whether pictures of robots can be drawn here."""

import pytest

from gaitopt.core.errors import GaitoptError
from gaitopt.report.film.gl import open_context


def opengl_is_missing() -> bool:
    """Whether there is no OpenGL here."""
    try:
        context = open_context(8, 8)
    except GaitoptError:
        return True
    context.free()
    return False


needs_opengl = pytest.mark.skipif(opengl_is_missing(), reason="no OpenGL: apt install libegl1 libosmesa6")
