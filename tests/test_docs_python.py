"""The blocks of docs/python.md are a program that runs, and says what the page says it does."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[1] / "docs" / "python.md"


def test_the_page_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)\n```", PAGE.read_text(encoding="utf-8"), re.S)
    space: dict[str, object] = {}
    exec(compile("\n".join(blocks), str(PAGE), "exec"), space)
    result, session, found = space["result"], space["session"], space["found"]
    assert len(blocks) == 5 and (session.result.path("cup") == result.path("cup")).all()
    assert result.path("tool").shape == (len(result.times), 7) and len(found.outcomes) == 5
    assert "grasp cup" in capsys.readouterr().out
