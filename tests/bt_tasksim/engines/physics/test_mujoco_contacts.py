"""Which shapes can touch, and what a pair is like."""

import itertools

import pytest

from bt_tasksim.engines.physics.mujoco_contacts import Body, ContactSurface, Solid, add_pair, touching_pairs
from bt_tasksim.engines.physics.rolling import SPINNING_RESISTANCE

BODIES = {
    "base": Body("base", -1, "base"),
    "arm": Body("link", -1, "arm", neighbours=frozenset({"base"})),
    "forearm": Body("link", -1, "forearm", neighbours=frozenset({"arm"})),
    "palm": Body("link", -1, "palm", neighbours=frozenset({"forearm"})),
    "left": Body("link", -1, "left", tip=0, neighbours=frozenset({"palm"})),
    "right": Body("link", -1, "right", tip=1, neighbours=frozenset({"palm"})),
    "cup": Body("object", 0, "cup"),
    "box": Body("object", 1, "box"),
    "table": Body("fixture", 2, "table"),
    "shelf": Body("fixture", 3, "shelf"),
}
NEVER = {
    "table shelf", "base table", "base shelf", "arm base", "forearm arm", "palm forearm", "palm arm",
    "forearm base", "palm base", "left palm", "right palm",
}  # fmt: skip


def pairs(names):
    solids = [Solid(f"{name}/{k}", BODIES[name], ContactSurface(0.5)) for name in names for k in range(2)]
    found = {frozenset((a.body.name, b.body.name)) for a, b in touching_pairs(solids)}
    assert all(len(pair) == 2 for pair in found), "nothing touches itself"
    return found


def test_pairs_are_those_that_can_touch_whatever_their_order():
    never = {frozenset(names.split()) for names in NEVER}
    expected = {frozenset(pair) for pair in itertools.combinations(BODIES, 2)} - never
    assert pairs(list(BODIES)) == pairs(list(BODIES)[::-1]) == expected


def compiled(a, b):
    """The model of one pair: each a body's name, its friction and its patch."""
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjSpec()
    solids = []
    for name, mu, patch in (a, b):
        body = spec.worldbody.add_body(name=name)
        body.add_freejoint()
        body.mass, body.inertia = 1.0, [1.0, 1.0, 1.0]
        body.add_geom(name=name, size=[0.1, 0.1, 0.1], contype=0, conaffinity=0)
        solids.append(Solid(name, BODIES[name], ContactSurface(mu, patch)))
    add_pair(spec, *solids)
    return spec.compile()


@pytest.mark.parametrize(
    ("a", "b", "friction", "twist", "condim"),
    [
        (("left", 1.2, 0.01), ("cup", 0.6, 0.0), 0.9, 0.009, 4),
        (("palm", 0.5, 0.0), ("cup", 0.7, 0.0), 0.6, 1e-5, 3),
        (("cup", 0.4, 0.0), ("table", 0.6, 0.0), 0.5, SPINNING_RESISTANCE, 6),
    ],
)
def test_friction_is_the_mean_and_pads_resist_twisting(a, b, friction, twist, condim):
    model = compiled(a, b)
    assert model.npair == 1 and model.pair_dim[0] == condim
    assert model.pair_friction[0, :2] == pytest.approx([friction, friction])
    assert model.pair_friction[0, 2] == pytest.approx(twist)


def test_fingertips_give_way_less_than_the_rest_of_the_hand_and_more_than_what_stands_on_something():
    cup = ("cup", 0.6, 0.0)
    tip, palm, table = (
        float(compiled((name, 0.5, 0.0), cup).pair_solref[0][0]) for name in ("left", "palm", "table")
    )
    assert table < tip < palm
    board = ("shelf", 0.5, 0.0)
    assert float(compiled(("left", 0.5, 0.0), board).pair_solref[0][0]) == palm, (
        "on furniture they are the hand"
    )
