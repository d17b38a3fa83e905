"""The benchmarks of many worlds, as a command."""

from __future__ import annotations

import json

import pytest

from benchmarks.batch.__main__ import main


def test_a_few_random_trees_are_the_same(tmp_path, capsys):
    assert main(["same-ticks", "--trees", "3", "--json", str(tmp_path / "found.json")]) == 0
    found = json.loads((tmp_path / "found.json").read_text())["same-ticks"]
    assert found["trees"] == 3 and found["ticks"] > 0 and "differs" not in found
    assert "3 trees" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing"], "no section 'nothing'"),
        (["same-ticks", "--trees", "0"], "at least 1"),
        (["executor", "--quick", "--device", "nowhere"], "'nowhere'"),
    ],
)
def test_bad_input_is_one_sentence(words, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err
