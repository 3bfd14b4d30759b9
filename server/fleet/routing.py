"""Which road a message takes: radio whenever it can, satellite only when it cannot or on request.

Streams, parameters and files never go by satellite, whatever anyone asks for: a byte there costs
money. An order to surface goes by every road at once.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from robot_link.messages import LinkState

MessageKind = Literal["plan", "command", "surface", "telemetry", "parameters", "files"]
Road = Literal["radio", "satellite"]
Wish = Literal["auto", "radio", "satellite"]
"""What the operator asks for: of one message, or of all of a kind by the settings."""

RADIO_ONLY = ("telemetry", "parameters", "files")
_REACHED = (LinkState.LIVE, LinkState.SUBMERGED)
"""States of a radio that will reach its robot; one that dives is expected to be silent."""


@dataclass(frozen=True, slots=True)
class Roads:
    """What is known of the roads to one robot."""

    radio: LinkState | None
    """Of the best radio; ``None`` for a robot without one."""
    radio_heard_at: datetime | None
    satellite: LinkState | None
    """Of the best satellite link; ``None`` for a robot without one."""
    satellite_heard_at: datetime | None

    @property
    def has_satellite(self) -> bool:
        """Whether a satellite link can be used."""
        return self.satellite not in (None, LinkState.UNPLUGGED)

    @property
    def radio_reaches(self) -> bool:
        """Whether the radio reaches the robot, now or when it comes up.

        A robot that dived out of the radio's sight and was heard by satellite since is elsewhere.
        """
        if self.radio is LinkState.LIVE:
            return True
        if self.radio not in _REACHED:
            return False
        here, there = self.radio_heard_at, self.satellite_heard_at
        return there is None or (here is not None and here >= there)


@dataclass(frozen=True, slots=True)
class Choice:
    """The roads that a message takes, and why."""

    roads: tuple[Road, ...]
    """Empty if there is none."""
    reason: str
    """One sentence for the operator."""


def carriers_for(kind: MessageKind, roads: Roads, setting: Wish, wish: Wish = "auto") -> Choice:
    """Choose the roads of a message.

    Args:
        kind: What is to be said.
        roads: The roads to the robot.
        setting: What the robot's settings say for this kind.
        wish: What the operator says for this message; goes before the setting.
    """
    if kind == "surface":
        return _everywhere(roads)
    if kind in RADIO_ONLY:
        return _radio(roads, f"{kind} never go by satellite".capitalize())
    asked = setting if wish == "auto" else wish
    if asked == "satellite":
        if roads.has_satellite:
            return Choice(("satellite",), "By satellite, as asked for.")
        return Choice((), f"By satellite as asked for, but {_satellite_fault(roads)}.")
    if asked == "radio":
        return _radio(roads, "By radio, as asked for")
    if roads.radio_reaches or not roads.has_satellite:
        return _radio(roads, "By radio, which reaches the robot" if roads.radio_reaches else "")
    return Choice(("satellite",), f"By satellite: {_radio_fault(roads)}.")


def _everywhere(roads: Roads) -> Choice:
    found: list[Road] = [] if roads.radio is None else ["radio"]
    if roads.has_satellite:
        found.append("satellite")
    return Choice(tuple(found), "By every link at once." if found else "The robot has no link.")


def _radio(roads: Roads, reason: str) -> Choice:
    if roads.radio is None:
        return Choice((), "The robot has no radio.")
    return Choice(("radio",), f"{reason or 'By radio, when it reaches the robot again'}.")


def _satellite_fault(roads: Roads) -> str:
    if roads.satellite is None:
        return "the robot has no satellite link"
    return "its satellite link is unplugged"


def _radio_fault(roads: Roads) -> str:
    match roads.radio:
        case None:
            return "the robot has no radio"
        case LinkState.NEVER_HEARD:
            return "it was never heard by radio"
        case LinkState.PORT_CLOSED:
            return "the radio's port is closed"
        case LinkState.UNPLUGGED:
            return "the radio is unplugged"
        case LinkState.SUBMERGED:
            return "it was heard by satellite since it left the radio's reach"
        case _:
            return "the radio does not reach the robot"
