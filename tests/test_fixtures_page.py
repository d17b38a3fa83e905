"""docs/fixtures.md: its tables are those of the code."""

from pathlib import Path

from bt_tasksim.core.registry import parts
from tools.fixtures_page import BEGIN, SHOWN, tables

PAGE = Path(__file__).parents[1] / "docs" / "fixtures.md"


def test_tables_are_up_to_date():
    made = [name for name, found in parts("fixture").items() if isinstance(found, type)]
    assert set(made) == set(SHOWN)
    assert f"{BEGIN}\n\n{tables()}" in PAGE.read_text(encoding="utf-8")
