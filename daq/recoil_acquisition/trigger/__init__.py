"""The trigger of a shot, live or recorded: `detector` decides, `shot_window` says what belongs to the shot."""

from recoil_acquisition.trigger.condition import Condition, Edge, PulseWidth, RateOfChange, Window
from recoil_acquisition.trigger.decision import Decision
from recoil_acquisition.trigger.detector import Trigger, TriggerDetector, find_triggers
from recoil_acquisition.trigger.shot_window import ShotCutter, ShotWindow
from recoil_acquisition.trigger.table import declared_trigger

__all__ = [
    "Condition",
    "Decision",
    "Edge",
    "PulseWidth",
    "RateOfChange",
    "ShotCutter",
    "ShotWindow",
    "Trigger",
    "TriggerDetector",
    "Window",
    "declared_trigger",
    "find_triggers",
]
