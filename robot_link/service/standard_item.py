"""One item of a standard MAVLink mission as a value, and what vehicles say to whole missions."""

import math
from dataclasses import dataclass

from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId

RESULTS = {
    grace.MAV_MISSION_ERROR: "it cannot take missions now",
    grace.MAV_MISSION_UNSUPPORTED_FRAME: "it does not know the frame of an item",
    grace.MAV_MISSION_UNSUPPORTED: "it does not know the command of an item",
    grace.MAV_MISSION_NO_SPACE: "the mission has too many items",
    grace.MAV_MISSION_INVALID: "an item has a parameter that it cannot take",
    grace.MAV_MISSION_INVALID_PARAM1: "parameter 1 of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM2: "parameter 2 of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM3: "parameter 3 of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM4: "parameter 4 of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM5_X: "the place of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM6_Y: "the place of an item is not possible",
    grace.MAV_MISSION_INVALID_PARAM7: "the altitude of an item is not possible",
    grace.MAV_MISSION_INVALID_SEQUENCE: "an item came out of turn",
    grace.MAV_MISSION_DENIED: "it does not take missions from this station",
    grace.MAV_MISSION_OPERATION_CANCELLED: "the transfer was cancelled",
}
"""Why a mission was not taken, by MAV_MISSION_RESULT."""


@dataclass(frozen=True, slots=True)
class StandardItem:
    """One item, in the wire's units; the four parameters are those of the command."""

    command: int
    frame: int
    x: int
    """Latitude, 1e-7 deg; in a local frame 1e-4 m."""
    y: int
    """Longitude, 1e-7 deg; in a local frame 1e-4 m."""
    z: float
    """Altitude, m, positive up; in a local frame down."""
    parameters: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    is_continued: bool = True
    """Whether the next item follows by itself."""

    def message(
        self, sequence: int, system: SystemId, component: int
    ) -> grace.MAVLink_mission_item_int_message:
        """Return the message that carries it."""
        return grace.MAVLink_mission_item_int_message(
            target_system=system,
            target_component=component,
            seq=sequence,
            frame=self.frame,
            command=self.command,
            current=int(sequence == 0),
            autocontinue=int(self.is_continued),
            param1=self.parameters[0],
            param2=self.parameters[1],
            param3=self.parameters[2],
            param4=self.parameters[3],
            x=self.x,
            y=self.y,
            z=self.z,
            mission_type=grace.MAV_MISSION_TYPE_MISSION,
        )

    def is_same(self, other: "StandardItem") -> bool:
        """Tell whether both say the same, to the wire's precision; an absent number is one."""
        mine = (*self.parameters, self.z)
        theirs = (*other.parameters, other.z)
        names = (self.command, self.frame, self.x, self.y)
        return names == (other.command, other.frame, other.x, other.y) and all(
            (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-6)
            for a, b in zip(mine, theirs, strict=True)
        )


def standard_item(message: grace.MAVLink_mission_item_int_message) -> StandardItem:
    """Return the item that a message carries."""
    return StandardItem(
        command=message.command,
        frame=message.frame,
        x=message.x,
        y=message.y,
        z=message.z,
        parameters=(message.param1, message.param2, message.param3, message.param4),
        is_continued=bool(message.autocontinue),
    )
