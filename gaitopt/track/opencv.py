"""OpenCV, which is installed with ``gaitopt[track]``."""

from __future__ import annotations

from types import ModuleType

from gaitopt.core.errors import GaitoptError


def opencv() -> ModuleType:
    """Return OpenCV.

    Raises:
        GaitoptError: it is not installed, or is too old.
    """
    try:
        import cv2
    except ImportError:
        raise GaitoptError("tags and films need OpenCV: pip install 'gaitopt[track]'") from None
    if not hasattr(cv2, "aruco") or not hasattr(cv2.aruco, "ArucoDetector"):
        raise GaitoptError(
            f"found OpenCV {cv2.__version__}; allowed: 4.7 or later, pip install 'gaitopt[track]'"
        )
    return cv2
