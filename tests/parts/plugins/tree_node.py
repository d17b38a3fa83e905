"""Two nodes of BehaviorTree.CPP from outside: a wait before a child, and RUNNING until a child fails."""

from collections.abc import Iterator, Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_tasksim.concept.context import Context
from bt_tasksim.core.registry import register
from trees.nodes.base import NodeKind, Port, free_children
from trees.nodes.batch import RUNNING, SUCCESS, NodePlace, PassesOn


class Delay(Decorator):
    """Waits for so many seconds of episode time, then ticks its child."""

    def __init__(self, name: str, child: Behaviour, seconds: float) -> None:
        super().__init__(name, child)
        self.seconds = seconds
        self.now = lambda: 0.0
        self.began = 0.0

    def setup(self, *, context: Context) -> None:
        self.now = lambda: context.now

    def tick(self) -> Iterator[Behaviour]:
        if self.status != Status.RUNNING:
            self.began = self.now()
        if self.now() - self.began < self.seconds - 1e-9:
            self.status = Status.RUNNING
            yield self
            return
        yield from self.decorated.tick()
        if self.decorated.status != Status.RUNNING:
            self.stop(self.decorated.status)
        self.status = self.decorated.status
        yield self

    def update(self) -> Status:
        return self.decorated.status


def delay(seconds: float, child: Behaviour, *, name: str = "Delay") -> Delay:
    """The child, after so many seconds."""
    return Delay(name, free_children(name, (child,))[0], seconds)


@register("tree node", "Delay")
class DelayKind(NodeKind[Delay]):
    category = "Decorator"
    behaviour = Delay
    symbol = "⧖"
    label = "delay"
    ports = (Port("delay_msec", doc="milliseconds of episode time"),)
    helper = staticmethod(delay)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Delay:
        return delay(ports["delay_msec"] / 1000, children[0], name=name)

    def read(self, node: Delay) -> dict[str, int]:
        return {"delay_msec": round(node.seconds * 1000)}

    def describe(self, node: Delay) -> str:
        return f"delay {node.seconds:g} s"


class KeepRunningUntilFailure(Decorator):
    """RUNNING as long as its child does not fail."""

    def update(self) -> Status:
        return Status.FAILURE if self.decorated.status == Status.FAILURE else Status.RUNNING


@register("tree node", "KeepRunningUntilFailure")
class KeepRunningKind(NodeKind[KeepRunningUntilFailure]):
    category = "Decorator"
    behaviour = KeepRunningUntilFailure
    symbol = "∞"
    label = "until it fails"

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> KeepRunningUntilFailure:
        return KeepRunningUntilFailure(name, children[0])

    def compiled(self, node: KeepRunningUntilFailure, place: NodePlace) -> PassesOn:
        return PassesOn(place, {SUCCESS: RUNNING})
