"""OpenCV, which is installed with ``gaitopt[track]``."""

from __future__ import annotations

import os
from types import ModuleType

from gaitopt.core.errors import GaitoptError

_LIBRARIES = "LD_LIBRARY_PATH"


def opencv() -> ModuleType:
    """Return OpenCV.

    Its import puts an empty entry into ``LD_LIBRARY_PATH``: every program started later would look for its
    libraries in the current folder. So the variable is set back.

    Raises:
        GaitoptError: it is not installed, or is too old.
    """
    path = os.environ.get(_LIBRARIES)
    try:
        import cv2
    except ImportError:
        raise GaitoptError("tags and films need OpenCV: pip install 'gaitopt[track]'") from None
    finally:
        if path is None:
            os.environ.pop(_LIBRARIES, None)
        else:
            os.environ[_LIBRARIES] = path
    if not hasattr(cv2, "aruco") or not hasattr(cv2.aruco, "ArucoDetector"):
        raise GaitoptError(
            f"found OpenCV {cv2.__version__}; allowed: 4.7 or later, pip install 'gaitopt[track]'"
        )
    return cv2
