"""Concepts and conditions: the leaves of trees, one file a concept."""

from __future__ import annotations

from bt_tasksim._names import one_module
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept_nodes.adjust_door import AdjustDoor
from bt_tasksim.concept_nodes.adjust_drawer import AdjustDrawer
from bt_tasksim.concept_nodes.arrangement import Beside, Clear, Inside, StandsOn
from bt_tasksim.concept_nodes.bring import Bring
from bt_tasksim.concept_nodes.close_door import CloseDoor
from bt_tasksim.concept_nodes.close_drawer import CloseDrawer
from bt_tasksim.concept_nodes.close_lid import CloseLid
from bt_tasksim.concept_nodes.conditions import AtPose, Holding, TimePassed, Upright
from bt_tasksim.concept_nodes.extract import Extract
from bt_tasksim.concept_nodes.grasp import Grasp
from bt_tasksim.concept_nodes.hand_conditions import HandEmpty, Lifted, Over, OverBeside
from bt_tasksim.concept_nodes.hold import Hold
from bt_tasksim.concept_nodes.hold_turned import HoldTurned
from bt_tasksim.concept_nodes.in_contact import InContact
from bt_tasksim.concept_nodes.insert import Insert
from bt_tasksim.concept_nodes.inserted import Inserted, OutOf
from bt_tasksim.concept_nodes.joint_conditions import IsOpen, IsShut, JointAt, OffStop, Slides, Turns
from bt_tasksim.concept_nodes.lay_down import LayDown
from bt_tasksim.concept_nodes.open_door import OpenDoor
from bt_tasksim.concept_nodes.open_drawer import OpenDrawer
from bt_tasksim.concept_nodes.open_lid import OpenLid
from bt_tasksim.concept_nodes.orientation import Oriented, PointingUp
from bt_tasksim.concept_nodes.pick import Pick
from bt_tasksim.concept_nodes.place import Place
from bt_tasksim.concept_nodes.pour import Pour
from bt_tasksim.concept_nodes.press_button import PressButton
from bt_tasksim.concept_nodes.pull import Pull
from bt_tasksim.concept_nodes.push import Push
from bt_tasksim.concept_nodes.release import Release
from bt_tasksim.concept_nodes.settle import Settle
from bt_tasksim.concept_nodes.slide import Slide
from bt_tasksim.concept_nodes.slide_off import SlideOff
from bt_tasksim.concept_nodes.slide_to_stop import SlideToStop
from bt_tasksim.concept_nodes.spin import Spin
from bt_tasksim.concept_nodes.stop_conditions import Against, ClearOf, HeldAgainst, PressedOn
from bt_tasksim.concept_nodes.tip_up import TipUp
from bt_tasksim.concept_nodes.turn import Turn
from bt_tasksim.concept_nodes.turn_knob import TurnKnob
from bt_tasksim.concept_nodes.turn_off_stop import TurnOffStop
from bt_tasksim.concept_nodes.turn_to_stop import TurnToStop
from bt_tasksim.concept_nodes.turned_conditions import Emptied, Lying, OnEnd, TurnedLike
from bt_tasksim.concept_nodes.wait import Wait
from bt_tasksim.concept_nodes.withdraw import Withdraw
from bt_tasksim.core.registry import parts

one_module(__name__)

__all__ = [
    "Against",
    "ClearOf",
    "HeldAgainst",
    "PressedOn",
    "PressButton",
    "TurnKnob",
    "OpenLid",
    "CloseLid",
    "TurnOffStop",
    "TurnToStop",
    "CloseDoor",
    "AdjustDoor",
    "OpenDoor",
    "OpenDrawer",
    "Turns",
    "Slides",
    "JointAt",
    "OffStop",
    "IsShut",
    "IsOpen",
    "CloseDrawer",
    "AdjustDrawer",
    "AtPose",
    "Beside",
    "Bring",
    "Clear",
    "Emptied",
    "Extract",
    "Grasp",
    "HandEmpty",
    "Hold",
    "HoldTurned",
    "Holding",
    "InContact",
    "Insert",
    "Inserted",
    "Inside",
    "LayDown",
    "Lifted",
    "Lying",
    "OnEnd",
    "Oriented",
    "OutOf",
    "Over",
    "OverBeside",
    "Pick",
    "Place",
    "PointingUp",
    "Pour",
    "Pull",
    "Push",
    "Release",
    "Settle",
    "Slide",
    "SlideOff",
    "SlideToStop",
    "StandsOn",
    "TimePassed",
    "Spin",
    "TipUp",
    "Turn",
    "TurnedLike",
    "Upright",
    "Wait",
    "Withdraw",
    "catalogue",
]


def catalogue() -> dict[str, type[ConceptModel] | type[Condition]]:
    """All concepts and conditions by name, as trees in XML name them; those of plugins, too."""
    return parts("concept")
