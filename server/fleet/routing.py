"""Which link a message takes: radio whenever it can, satellite only when it cannot or on request.

Streams, parameters and files never go by satellite, whatever anyone asks for: a byte there costs
money. An order to surface goes by every link at once.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

from robot_link.messages import LinkState

MessageKind = Literal["plan", "command", "surface", "telemetry", "parameters", "files"]
LinkKind = Literal["radio", "satellite"]
RequestedLink = Literal["auto", "radio", "satellite"]
"""What the operator asks for: of one message, or of all of a kind by the settings."""

RADIO_ONLY = ("telemetry", "parameters", "files")
_REACHED = (LinkState.LIVE, LinkState.SUBMERGED)
"""States of a radio that will reach its robot; one that dives is expected to be silent."""


@dataclass(frozen=True, slots=True)
class KnownLinks:
    """What is known of the links to one robot."""

    radio: LinkState | None
    """Of the best radio; ``None`` for a robot without one."""
    radio_heard_at: datetime | None
    satellite: LinkState | None
    """Of the best satellite link; ``None`` for a robot without one."""
    satellite_heard_at: datetime | None

    @property
    def has_satellite(self) -> bool:
        """Whether a satellite link can be used."""
        return self.satellite not in (None, LinkState.DISABLED)

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
class LinkChoice:
    """The links that a message takes, and why."""

    links: tuple[LinkKind, ...]
    """Empty if there is none."""
    reason: str
    """One sentence for the operator."""


def choose_links(
    kind: MessageKind, known: KnownLinks, setting: RequestedLink, requested: RequestedLink = "auto"
) -> LinkChoice:
    """Choose the links of a message.

    Args:
        kind: What is to be said.
        known: The links to the robot.
        setting: What the robot's settings say for this kind.
        requested: What the operator says for this message; goes before the setting.
    """
    if kind == "surface":
        return _everywhere(known)
    if kind in RADIO_ONLY:
        return _radio(known, f"{kind} never go by satellite".capitalize())
    asked = setting if requested == "auto" else requested
    if asked == "satellite":
        if known.has_satellite:
            return LinkChoice(("satellite",), "By satellite, as asked for.")
        return LinkChoice((), f"By satellite as asked for, but {_satellite_fault(known)}.")
    if asked == "radio":
        return _radio(known, "By radio, as asked for")
    if known.radio_reaches or not known.has_satellite:
        return _radio(known, "By radio, which reaches the robot" if known.radio_reaches else "")
    return LinkChoice(("satellite",), f"By satellite: {_radio_fault(known)}.")


def _everywhere(known: KnownLinks) -> LinkChoice:
    found: list[LinkKind] = [] if known.radio is None else ["radio"]
    if known.has_satellite:
        found.append("satellite")
    return LinkChoice(tuple(found), "By every link at once." if found else "The robot has no link.")


def _radio(known: KnownLinks, reason: str) -> LinkChoice:
    if known.radio is None:
        return LinkChoice((), "The robot has no radio.")
    return LinkChoice(("radio",), f"{reason or 'By radio, when it reaches the robot again'}.")


def _satellite_fault(known: KnownLinks) -> str:
    if known.satellite is None:
        return "the robot has no satellite link"
    return "its satellite link is unplugged"


def _radio_fault(known: KnownLinks) -> str:
    match known.radio:
        case None:
            return "the robot has no radio"
        case LinkState.NEVER_HEARD:
            return "it was never heard by radio"
        case LinkState.MUTE:
            return "the station's radio does not answer"
        case LinkState.PORT_CLOSED:
            return "the radio's port is closed"
        case LinkState.DISABLED:
            return "the radio is unplugged"
        case LinkState.SUBMERGED:
            return "it was heard by satellite since it left the radio's reach"
        case _:
            return "the radio does not reach the robot"
