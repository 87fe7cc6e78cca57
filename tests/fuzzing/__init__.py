"""Broken and hostile input, generated: whole files and mutations of them, and what must hold of each.

A case is made from its seed, kind and number alone, so any can be made again. It is a command line, or
a reader called directly, in a folder of files of which some are broken. It must end in success or in
one clear line, and must leave no half-written file and no changed input behind.
"""

from fuzzing.material import finished_run
from fuzzing.outcome import LIMIT_S, WHOLE_LIMIT_S, attempt
from fuzzing.registry import KINDS, WHOLE, make

__all__ = ["KINDS", "LIMIT_S", "WHOLE", "WHOLE_LIMIT_S", "attempt", "finished_run", "make"]
