"""Plays a table of commands: rows of pulse widths or angles, each sent when its time has come.

Runs in MicroPython and in Python alike. Call `tick` as often as you like; when it returns True, send `cells`,
one a servo (None: unpowered), and note `at_us`, the time at which you did. Rows lie on a grid that begins at
`start`, so jitter of the calls does not add up, and a late call skips rows instead of slowing down.
"""

_CLOCK = (1 << 32) - 1


class CommandPlayer:
    """A table of commands being played.

    Args:
        rows: rows of cells, one cell a servo.
        row_us: time between two rows, µs.

    Raises:
        ValueError: it cannot be played.
    """

    def __init__(self, rows: "tuple[tuple[int | float | None, ...], ...]", row_us: int) -> None:
        if not rows or not rows[0]:
            raise ValueError("ROWS: found none; allowed: at least one, of at least one cell")
        for row in rows:
            if len(row) != len(rows[0]):
                raise ValueError(f"ROWS: found a row of {len(row)} cells; allowed: {len(rows[0])}")
        if not (isinstance(row_us, int) and row_us > 0):
            raise ValueError(f"ROW_US: found {row_us!r}; allowed: a whole number above 0")
        self.rows = rows
        self.row_us = row_us
        self.start(0)

    def start(self, now_us: int) -> None:
        """Begin: the first row is due now."""
        self.last_us = now_us & _CLOCK
        self.at_us = 0
        self.row = -1

    def tick(self, now_us: int) -> bool:
        """Return True when another row is due; `now_us` is a clock of 32 bits, µs."""
        self.at_us += (now_us - self.last_us) & _CLOCK
        self.last_us = now_us & _CLOCK
        due = self.at_us // self.row_us
        if due == self.row or due >= len(self.rows):
            return False
        self.row = due
        return True

    def cells(self) -> "tuple[int | float | None, ...]":
        """Return the cells of the row that is due."""
        return self.rows[self.row]

    def done(self) -> bool:
        """Return whether the last row has been held for its time, too."""
        return self.at_us >= len(self.rows) * self.row_us

    def line(self, read: "tuple[float, ...]" = ()) -> str:
        """Return a line of a log: when the row was sent, s, its cells, and what was read then."""
        at = f"{self.at_us // 1000000}.{self.at_us % 1000000:06d}"
        cells = ["" if cell is None else repr(cell) for cell in self.cells()]
        return ",".join([at] + cells + [repr(value) for value in read])
