"""Generated broken and hostile input: complete files and mutations of them, and what must hold for each.

A case depends only on its seed, kind and number, so it can be made again. It is a command line, or
a reader called directly, in a folder of files of which some are broken. It must end in success or in
one clear line, and must leave no half-written file and no changed input behind.
"""

from fuzzing.material import finished_run
from fuzzing.outcome import LIMIT_S, WHOLE_LIMIT_S, attempt
from fuzzing.registry import KINDS, WHOLE, make

__all__ = ["KINDS", "LIMIT_S", "WHOLE", "WHOLE_LIMIT_S", "attempt", "finished_run", "make"]
