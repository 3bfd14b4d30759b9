"""A mission as MAVLink items: settings, trim, tuning, rules, then the legs, circles after theirs.

A mission that follows a target has its order behind the trim, and neither tuning nor legs.

Every number is an integer of ``robot_link.mission``'s canonical form, exact in its field.
"""

from collections.abc import Sequence

from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.mission import Mission
from robot_link.onboard_settings import OnboardSettings
from robot_link.surfacing_order import SurfacingOrder
from robot_link.target_settings import TargetSettings

MissionItem = grace.MAVLink_mission_item_int_message

_LEG_COMMANDS = (
    grace.MAV_CMD_GRACE_GLIDE,
    grace.MAV_CMD_GRACE_SPIRAL,
    grace.MAV_CMD_GRACE_DIVE,
    grace.MAV_CMD_GRACE_SWIM,
    grace.MAV_CMD_GRACE_KEEP,
)
"""In the order of the canonical form's kinds."""
_TUNING, _TRACK = grace.MAV_CMD_GRACE_TUNING, grace.MAV_CMD_GRACE_TRACK
_RULES = grace.MAV_CMD_GRACE_RULES
_NUMBERS = 7
"""Integers in one item: four parameters and the position, all exact in a float32."""
_NUMBERS_FIRST = 2
"""Where tuning, or the order to follow a target, begins: behind settings and trim."""


def mission_items(mission: Mission, system: SystemId) -> tuple[MissionItem, ...]:
    """Return the items that carry a mission to a robot, numbered from 0."""
    sample_ms, uncertainty_mm, timeout_s, x_mm, y_mm, *trim = mission.settings_integers()
    items = [
        _item(
            grace.MAV_CMD_GRACE_SETTINGS,
            params=(sample_ms, uncertainty_mm, timeout_s, 0),
            position=(x_mm, y_mm, 0),
        )
    ]
    if trim:
        params = (trim[0], trim[1], 0, 0)
        items.append(_item(grace.MAV_CMD_GRACE_TRIM, params=params, position=(0, 0, 0)))
    if mission.onboard is not None:
        items += _number_items(_TUNING, mission.onboard.integers())
    if mission.tracking is not None:
        items += _number_items(_TRACK, mission.tracking.integers())
    if mission.rules is not None:
        items += _number_items(_RULES, mission.rules.integers())
    for kind, x, y, z, speed, duration, energy, heading, radius, turn in mission.leg_integers():
        params = (speed, duration, energy, heading)
        items.append(_item(_LEG_COMMANDS[kind], params=params, position=(x, y, z)))
        if radius or turn:
            items.append(
                _item(grace.MAV_CMD_GRACE_CIRCLE, params=(radius, turn, 0, 0), position=(0, 0, 0))
            )
    for number, item in enumerate(items):
        item.seq = number
        item.target_system = system
    return tuple(items)


def item_count(mission: Mission) -> int:
    """Return how many items carry a mission."""
    return len(mission_items(mission, SystemId(0)))


def mission_from_items(items: Sequence[MissionItem]) -> Mission:
    """Rebuild the mission that items carry.

    Raises:
        ValueError: If the items are no mission; the message names the first that does not fit.
    """
    if not items or items[0].command != grace.MAV_CMD_GRACE_SETTINGS:
        raise ValueError("item 0 does not carry the settings")
    first = _integers(items[0])
    settings = (*first[:3], *first[4:6])
    legs: list[tuple[int, ...]] = []
    numbers: dict[int, list[int]] = {_TUNING: [], _TRACK: [], _RULES: []}
    for number, item in enumerate(items[1:], start=1):
        integers = _integers(item)
        if item.command in _LEG_COMMANDS:
            kind = _LEG_COMMANDS.index(item.command)
            legs.append((kind, *integers[4:], *integers[:4], 0, 0))
        elif item.command == grace.MAV_CMD_GRACE_CIRCLE and legs and legs[-1][-2:] == (0, 0):
            legs[-1] = (*legs[-1][:-2], *integers[:2])
        elif item.command == grace.MAV_CMD_GRACE_TRIM and number == 1:
            settings = (*settings, *integers[:2])
        elif item.command in numbers and number == _NUMBERS_FIRST + (
            _before(numbers, item.command) // _NUMBERS
        ):
            numbers[item.command] += integers
        else:
            raise ValueError(f"item {number} with command {item.command} does not belong there")
    tuning, track = numbers[_TUNING], numbers[_TRACK]
    onboard = OnboardSettings.from_integers(tuning) if tuning else None
    tracking = TargetSettings.from_integers(track) if track else None
    rules = SurfacingOrder.from_integers(numbers[_RULES]) if numbers[_RULES] else None
    return Mission.from_integers(settings, tuple(legs), onboard, tracking, rules)


def _before(numbers: dict[int, list[int]], command: int) -> int:
    """Return how many integers came before the next item of a kind; rules follow tuning."""
    tuning = len(numbers[_TUNING]) if command == _RULES else 0
    return tuning + len(numbers[command])


def _number_items(command: int, integers: Sequence[int]) -> list[MissionItem]:
    """Return the items that carry integers by sevens, the last filled up with zeros."""
    items: list[MissionItem] = []
    for first in range(0, len(integers), _NUMBERS):
        part = integers[first : first + _NUMBERS]
        a, b, c, d, x, y, z = (*part, *(0,) * (_NUMBERS - len(part)))
        items.append(_item(command, params=(a, b, c, d), position=(x, y, z)))
    return items


def _item(
    command: int, *, params: tuple[int, int, int, int], position: tuple[int, int, int]
) -> MissionItem:
    return MissionItem(
        target_system=0,
        target_component=grace.MAV_COMP_ID_AUTOPILOT1,
        seq=0,
        frame=grace.MAV_FRAME_MISSION,
        command=command,
        current=0,
        autocontinue=1,
        param1=params[0],
        param2=params[1],
        param3=params[2],
        param4=params[3],
        x=position[0],
        y=position[1],
        z=position[2],
        mission_type=grace.MAV_MISSION_TYPE_MISSION,
    )


def _integers(item: MissionItem) -> tuple[int, ...]:
    """Return the four parameters and the position; each must be whole."""
    numbers = (item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z)
    if not all(float(number).is_integer() for number in numbers):
        raise ValueError(f"item {item.seq} holds a number that is not whole")
    return tuple(int(number) for number in numbers)
