"""The pages "add a part" show the plugins that these tests use, to the letter."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent / "plugins"
PAGES = Path(__file__).parents[2] / "docs" / "parts"


@pytest.mark.parametrize("stem", sorted(file.stem for file in FOLDER.glob("*.py")))
def test_the_page_shows_the_plugin_as_it_is_tested(stem):
    page = PAGES / f"{stem}.md"
    if not page.exists():
        pytest.skip("this kind of part has no page of its own")
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert (FOLDER / f"{stem}.py").read_text(encoding="utf-8") in blocks
