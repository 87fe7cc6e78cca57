"""The job `new`: a commented problem file for a new robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gaitopt.problem.draft import Draft, make_problem
from gaitopt.problem.lookup import PROBLEM_FILE


@dataclass(frozen=True)
class NewProblem:
    """A problem folder that was drafted.

    Attributes:
        folder: the folder.
        draft: what was read and guessed of the robot.
    """

    folder: Path
    draft: Draft

    def to_dict(self) -> dict[str, object]:
        """Return what `gaitopt new --json` prints."""
        draft, roles = self.draft, self.draft.roles
        return {
            "problem": str(self.folder / PROBLEM_FILE),
            "family": draft.family,
            "channels": [channel.name for channel in draft.channels],
            "marker": roles.marker,
            "pads": list(roles.pads),
            "gaits": [gait.name for gait in draft.gaits],
            "stance": draft.stance,
            "guessed": list(draft.remarks),
            "look": list(draft.warnings),
            "changed": list(draft.changes),
        }


def draft_problem(
    name: str,
    mjcf: Path | str,
    out: Path | str | None = None,
    *,
    from_motors: bool = False,
    family: str | None = None,
) -> NewProblem:
    """Draft the problem file of a new robot, in a folder with its MJCF.

    Args:
        name: name of the problem.
        mjcf: the robot.
        out: a new or an empty folder; named after the problem by default.
        from_motors: whether motors become position servos, with what is assumed said in the file.
        family: ``crawler``, ``quadruped``, ``hexapod``, ``snake``, ``swimmer`` or ``other``; guessed by
            default.

    Raises:
        GaitoptError: the name or the MJCF cannot be used, or the folder holds something.
    """
    folder = Path(name if out is None else out)
    return NewProblem(folder, make_problem(name, Path(mjcf), folder, from_motors, family))
