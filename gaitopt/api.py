"""The public face under its older name: everything here is also in `gaitopt` itself."""

from __future__ import annotations

from gaitopt import *  # noqa: F403
from gaitopt import __all__ as __all__
