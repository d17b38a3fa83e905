"""Tables of what was learned: every measured number has a cell, whatever its size."""

from benchmarks import learned_tables
from benchmarks.learning import ROWS


def test_every_row_of_the_speed_table_is_filled():
    found = {row.key: 1.2e-9 if row.digits < 0 else 12.345 for row in ROWS}
    lines = learned_tables.learning({"learning": found}).splitlines()[2:]
    assert len(lines) == len(ROWS) and not any("not measured" in line for line in lines)
    assert sum("1.2e-09" in line for line in lines) == 1
    assert all("not measured" in line for line in learned_tables.learning({}).splitlines()[2:])
