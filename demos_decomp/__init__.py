"""From a demonstration log to tasks and their graph.

log = open_log("kitchen.h5")
found = decompose_log(log)
print(text_table(found.tasks))
found.graph                 # networkx.DiGraph, see demos_decomp.graph
"""

from demos_decomp.decompose import decompose, decompose_log
from demos_decomp.graph import build_graph, graph_to_json, in_order
from demos_decomp.log import Demonstration, Log, Surface, Track, Utterance, Video, surface_of
from demos_decomp.log_file import read_log, write_log
from demos_decomp.picture import picture, write_picture
from demos_decomp.readers import open_log, register
from demos_decomp.table import text_table
from demos_decomp.tasks import Decomposition, Task

__all__ = [
    "open_log",
    "read_log",
    "write_log",
    "register",
    "decompose",
    "decompose_log",
    "Decomposition",
    "Task",
    "Log",
    "Demonstration",
    "Track",
    "Surface",
    "surface_of",
    "Utterance",
    "Video",
    "build_graph",
    "in_order",
    "graph_to_json",
    "text_table",
    "picture",
    "write_picture",
]
