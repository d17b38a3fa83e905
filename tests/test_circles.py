"""No circle of imports between modules, not even one that only a type checker sees."""

from __future__ import annotations

import grimp
import networkx as nx


def test_no_module_imports_itself_through_others():
    graph = grimp.build_graph("bt_tasksim", exclude_type_checking_imports=False, cache_dir=None)
    imports: nx.DiGraph[str] = nx.DiGraph(
        (module, other)
        for module in graph.modules
        for other in graph.find_modules_directly_imported_by(module)
    )
    assert len(imports) > 200, "the packages behind links are in it"
    assert [sorted(found) for found in nx.strongly_connected_components(imports) if len(found) > 1] == []


def test_the_rooms_have_no_exceptions():
    import tomllib
    from pathlib import Path

    settings = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = settings["tool"]["importlinter"]["contracts"]
    assert contract["exhaustive"]
    assert "ignore_imports" not in contract
