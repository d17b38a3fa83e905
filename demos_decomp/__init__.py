"""From a demonstration log to tasks and their graph.

log = open_log("kitchen.h5")
found = decompose_log(log)
print(found.table())
found.graph                 # networkx.DiGraph, see demos_decomp.graph
"""

from bt_tasksim._names import one_module
from bt_tasksim.concept.task import Task
from bt_tasksim.demos_decomp.decompose import Decomposition, decompose, decompose_log
from bt_tasksim.demos_decomp.graph import build_graph, graph_to_json, in_order
from bt_tasksim.demos_decomp.log import Demonstration, Log, Surface, Track, Utterance, Video, surface_of
from bt_tasksim.demos_decomp.log_file import read_log, write_log
from bt_tasksim.demos_decomp.picture import picture, write_picture
from bt_tasksim.demos_decomp.readers import LogReader, open_log
from bt_tasksim.demos_decomp.remarks import Remark, RemarkKind
from bt_tasksim.demos_decomp.table import text_table

one_module(__name__)

__all__ = [
    "open_log",
    "read_log",
    "write_log",
    "LogReader",
    "decompose",
    "decompose_log",
    "Decomposition",
    "Remark",
    "RemarkKind",
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
