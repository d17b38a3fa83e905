"""The programmed actions of a grasp: it gives way where it is pressed, and feels its way in little room."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import grasp_features
from bt_tasksim.concept_nodes.grasp_features import ACROSS, ALONG, HASTE, SCALE
from bt_tasksim.concept_nodes.grasp_landing import STANDS, Landing, landing, paced
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.limits import gentler
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.planning.hand_collision import beyond
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import standing_side, tips_in_tool

FEELING = 0.05
"""Speed in m/s at which a programmed grasp feels its way where it has little room: a finger that meets an
edge at 0.18 m/s presses 78 N before it can be stopped."""
RIGID = 0.5
"""Share of that at a part of furniture, which does not give way: a finger that meets a spoke of a valve at
0.05 m/s presses 66 N."""
DEEP = 0.04
"""Metres before the grasp from which on fingers may meet an edge."""
BOUNCING = 0.0015
"""Metres by which a hand of which a finger has touched something is held up: it waits."""
SURELY_ABOVE = 0.008
"""The same above an object's top, for the ends of a jaw that swings: they go far down beside what is tall."""
YIELDS = 15.0
"""Newtons against the approach from which on a hand gives way: a finger that stands on something as it comes,
or a jaw that swings and presses what it closes on against its support."""
YIELDING = 0.0008
"""Metres by which it does so in a control period, at twice that force and beyond; it does not come back."""
PRESSES, OUTSIDE = 5.0, 0.01
"""Newtons against the approach from which on the wrist tells where a finger stands on something, and metres
beyond its pad from which on that is beside what it is to take, so that the way out of it is inwards. A finger
of the Panda is 15 mm thick; one that stands on the rim of what it takes is pressed at its inner edge."""
SEARCHING = 0.2
"""Share of the largest action with which it then goes aside, 1 mm in a control period, as it goes back: any
faster, the finger takes the object's rim with it and tips it over."""


def motion(seen: Seen, memory: GraspMemory, target: str) -> Array:
    """Actions ``(N, 6)``, see `Grasp.programmed_motion`.

    Args:
        seen: What the concept sees.
        memory: What the grasp remembers.
        target: The object.
    """
    xp, palm = array_namespace(memory.middle), landing(seen, memory)
    still = yielding(seen, memory, palm)
    pace = xp.where(palm.near, palm.pace, xp.full_like(palm.pace, HASTE))
    usual = xp.concat([still, pace[:, None]], axis=-1)
    if not bool(xp.any(memory.tight)):
        return usual
    return xp.where(memory.tight[:, None], feeling(seen, memory, target, palm), usual)


def yielding(seen: Seen, memory: GraspMemory, palm: Landing) -> Array:
    """Offsets ``(N, 5)`` asked for by a hand that gives way where it touches something, see `YIELDS`."""
    xp = array_namespace(memory.offset)
    push = poses.clip(-seen.wrench[:, 2] / YIELDS - 1.0, 0.0, 1.0)
    begun = seen.elapsed - memory.delay >= memory.begins
    back = xp.where(begun & xp.any(seen.contacts, axis=-1), YIELDING * push, xp.zeros_like(push))
    back = xp.where(palm.near, xp.maximum(back, palm.back), back)
    gone = memory.offset[:, ALONG] - back
    wanted = gone / SCALE[ALONG] - memory.middle[:, ALONG]
    yields = (gone < 0.0) | (back > 0.0)
    asked = xp.where(yields, -xp.sqrt(poses.clip(-wanted, 0.0, 1.0)), xp.zeros_like(gone))
    return asked[:, None] * grasp_features.axis(ALONG, asked)


def feeling(seen: Seen, memory: GraspMemory, target: str, palm: Landing) -> Array:
    """Actions ``(N, 6)`` of a hand that feels its way, see `programmed_motion`."""
    xp = array_namespace(memory.middle)
    outwards = _way_out(seen, memory)
    near = (poses.norm(seen.tool[:, :3] - memory.goal[:, :3]) < DEEP) | _among(seen, memory, target)
    share = gentler(seen.tool)
    share = xp.where(seen.model(target).jointed, RIGID * share, share)
    most = FEELING * xp.where(near, share, xp.ones_like(share))
    pace = paced(palm.goes, most * seen.world.control_period)
    pace = xp.where(palm.near, xp.minimum(pace, palm.pace), pace)
    slower, stands = xp.minimum(pace, xp.zeros_like(pace)), xp.full_like(pace, STANDS)
    pace = xp.where(xp.any(seen.contacts, axis=-1), slower, pace)
    # A finger that stands on an edge bounces: it must not be pressed down while it does not touch.
    held_up = poses.localise(memory.target, seen.tool[:, :3])[:, 2] < -BOUNCING
    comes_down = (memory.closing < 0.0) & xp.any(memory.touched > 0.0, axis=-1)
    pace = xp.where(held_up & comes_down, stands, pace)
    aside = SEARCHING * outwards[:, None] * grasp_features.axis(ACROSS, outwards)
    return xp.concat([aside + yielding(seen, memory, palm), pace[:, None]], axis=-1)


def _way_out(seen: Seen, memory: GraspMemory) -> Array:
    """In which direction ``(N,)`` along the closing axis a finger comes off what it stands on, -1 to 1, or 0.

    Away from the other finger, unless the torque at the wrist says that its outer edge stands there.
    """
    xp = array_namespace(memory.middle)
    touching = xp.astype(seen.contacts, memory.middle.dtype)
    pads = constant(_pads(seen.robot), touching)
    outwards = poses.clip(xp.sum(touching * xp.sign(pads), axis=-1), -1.0, 1.0)
    along = seen.wrench[:, 2]
    presses, alone = along < -PRESSES, xp.sum(touching, axis=-1) == 1.0
    at = seen.wrench[:, 3] / xp.where(presses, along, xp.ones_like(along))
    pad = xp.sum(touching * pads, axis=-1)
    beyond_it = (at * xp.sign(pad) - abs(pad)) > OUTSIDE
    return xp.where(presses & alone & beyond_it, -outwards, outwards)


def _among(seen: Seen, memory: GraspMemory, target: str) -> Array:
    """Whether ``(N,)`` the ends of a hand with a jaw that swings may meet the object as it is seen."""
    xp, along = array_namespace(memory.goal), poses.z_axis(memory.goal[:, 3:])
    if standing_side(seen.robot) is None:
        return xp.zeros(along.shape[:1], dtype=xp.bool, device=along.device)
    here = seen.object(target)
    top = half_extent(here, seen.model(target), along) + SURELY_ABOVE
    return poses.dot(seen.tool[:, :3] - here[:, :3], along) + beyond(seen.robot) > -top


def _pads(robot: RobotDescription) -> Array:
    """Where along the closing axis ``(n_tips,)`` each fingertip of the open hand is, metres."""
    found: Array = robot.derived("pads", lambda robot: tips_in_tool(robot, robot.hand_open)[:, 1])
    return found
