"""The job `runs`: a list of run folders, and its page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gaitopt.core.files import check_replaceable, write_text
from gaitopt.runs.listing import ListedRun
from gaitopt.runs.listing import list_runs as listed


def list_runs(folders: Sequence[Path | str] = (), html: Path | str | None = None) -> list[ListedRun]:
    """Return the runs in some folders, the latest last.

    Args:
        folders: run folders, or folders that hold some; by default the current one and ``results/runs``.
        html: also write a page with all of them side by side into this file.

    Raises:
        GaitoptError: a folder is none or cannot be read, or the page cannot be written.
    """
    if html is not None:
        check_replaceable(Path(html))
    runs = listed(map(Path, folders))
    if html is not None:
        from gaitopt.report.runs import index_page  # Matplotlib takes a second, which a list does not need

        write_text(Path(html), index_page(runs, Path(html).parent))
    return runs
