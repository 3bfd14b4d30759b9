"""The mode of a vehicle of another maker in words, by the family of its autopilot."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from robot_link.mavlink.wire import grace

SUB_MODES: Final[Mapping[int, str]] = MappingProxyType(
    {
        0: "STABILIZE",
        1: "ACRO",
        2: "ALT_HOLD",
        3: "AUTO",
        4: "GUIDED",
        7: "CIRCLE",
        9: "SURFACE",
        16: "POSHOLD",
        19: "MANUAL",
        20: "MOTOR_DETECT",
        21: "SURFTRAK",
    }
)
"""Names of ArduSub's custom modes."""
ROVER_MODES: Final[Mapping[int, str]] = MappingProxyType(
    {
        0: "MANUAL",
        1: "ACRO",
        3: "STEERING",
        4: "HOLD",
        5: "LOITER",
        6: "FOLLOW",
        7: "SIMPLE",
        10: "AUTO",
        11: "RTL",
        12: "SMART_RTL",
        15: "GUIDED",
        16: "INITIALISING",
    }
)
"""Names of ArduPilot's custom modes for boats."""
_WORDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "STABILIZE": "keeps its attitude",
        "ACRO": "keeps its turn rates",
        "ALT_HOLD": "holds its depth",
        "AUTO": "flies its mission",
        "GUIDED": "goes where it is told",
        "CIRCLE": "circles",
        "SURFACE": "comes up",
        "POSHOLD": "holds its place",
        "MANUAL": "is steered by hand",
        "MOTOR_DETECT": "tries its motors",
        "SURFTRAK": "keeps its height above the floor",
        "HOLD": "holds",
        "LOITER": "holds its place",
        "RTL": "returns to where it began",
        "SMART_RTL": "returns the way it came",
        "STEERING": "keeps its turn",
        "FOLLOW": "follows another vehicle",
    }
)
_PX4_MAIN: Final = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    4: "AUTO",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_PX4_AUTO: Final = {
    1: "READY",
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    8: "FOLLOW_TARGET",
    9: "PRECLAND",
}
_PX4_WORDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "MANUAL": "is steered by hand",
        "ALTCTL": "holds its depth",
        "POSCTL": "holds its place",
        "ACRO": "keeps its turn rates",
        "OFFBOARD": "goes where it is told",
        "STABILIZED": "keeps its attitude",
        "AUTO.MISSION": "flies its mission",
        "AUTO.LOITER": "holds its place",
        "AUTO.RTL": "returns to where it began",
        "AUTO.LAND": "lands",
    }
)
_NOT_TOLD: Final = "a mode that it does not tell"

_KINDS: Final[Mapping[int, str]] = MappingProxyType(
    {
        grace.MAV_TYPE_SUBMARINE: "submarine",
        grace.MAV_TYPE_SURFACE_BOAT: "surface boat",
        grace.MAV_TYPE_GROUND_ROVER: "rover",
        grace.MAV_TYPE_FIXED_WING: "aeroplane",
        grace.MAV_TYPE_QUADROTOR: "quadrotor",
        grace.MAV_TYPE_GENERIC: "vehicle",
    }
)

_LANDED: Final[Mapping[int, str]] = MappingProxyType(
    {
        grace.MAV_LANDED_STATE_ON_GROUND: "on the ground",
        grace.MAV_LANDED_STATE_IN_AIR: "under way",
        grace.MAV_LANDED_STATE_TAKEOFF: "taking off",
        grace.MAV_LANDED_STATE_LANDING: "landing",
    }
)


def autopilot_title(autopilot: int, kind: int) -> str:
    """Return the name of a vehicle's autopilot, such as ArduSub."""
    if autopilot == grace.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return {
            grace.MAV_TYPE_SUBMARINE: "ArduSub",
            grace.MAV_TYPE_SURFACE_BOAT: "ArduPilot Rover",
        }.get(kind, "ArduPilot")
    if autopilot == grace.MAV_AUTOPILOT_PX4:
        return "PX4"
    return "Autopilot"


def kind_title(kind: int) -> str:
    """Return what a vehicle is, such as submarine."""
    return _KINDS.get(kind, f"vehicle of type {kind}")


def mode_name(autopilot: int, kind: int, base_mode: int, custom_mode: int) -> str:
    """Return the autopilot's own name of a mode, such as ALT_HOLD or AUTO.MISSION."""
    is_custom = base_mode & grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    if autopilot == grace.MAV_AUTOPILOT_ARDUPILOTMEGA and is_custom:
        names = SUB_MODES if kind == grace.MAV_TYPE_SUBMARINE else ROVER_MODES
        is_known = kind in (grace.MAV_TYPE_SUBMARINE, grace.MAV_TYPE_SURFACE_BOAT)
        return names.get(custom_mode, f"mode {custom_mode}") if is_known else f"mode {custom_mode}"
    if autopilot == grace.MAV_AUTOPILOT_PX4 and is_custom:
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        name = _PX4_MAIN.get(main, f"mode {main}")
        return f"{name}.{_PX4_AUTO.get(sub, sub)}" if main == 4 and sub else name
    return _generic_name(base_mode) or (f"mode {custom_mode}" if is_custom else _NOT_TOLD)


def mode_words(autopilot: int, name: str) -> str:
    """Return what a vehicle does in a mode, "" where only its name is known."""
    words = _PX4_WORDS if autopilot == grace.MAV_AUTOPILOT_PX4 else _WORDS
    return words.get(name, "")


def landed_words(state: int) -> str:
    """Return what a vehicle says of its stand (EXTENDED_SYS_STATE), "" where it says nothing."""
    return _LANDED.get(state, "")


def _generic_name(base_mode: int) -> str:
    """Return a mode by the flags of the standard alone, "" where they say none."""
    for flag, name in (
        (grace.MAV_MODE_FLAG_AUTO_ENABLED, "AUTO"),
        (grace.MAV_MODE_FLAG_GUIDED_ENABLED, "GUIDED"),
        (grace.MAV_MODE_FLAG_STABILIZE_ENABLED, "STABILIZE"),
        (grace.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED, "MANUAL"),
    ):
        if base_mode & flag:
            return name
    return ""
