"""What a vehicle of another maker understands as our orders."""

from typing import Literal

from autonomy.configuration import Configuration, quantity

OrderWay = Literal["mode", "command", "mission_item"]


class StandardCommandConfig(Configuration):
    """How orders are told to a vehicle that speaks standard MAVLink; the numbers are the maker's.

    An order counts as applied only when the vehicle's own reports prove it.
    """

    surface_by: OrderWay = quantity("mode", title="Surface by")
    """mode: change to a mode, proved by the heartbeat. command: a MAV_CMD, proved by a depth that
    becomes less. mission_item: jump to an item of its mission that leads up, proved by
    MISSION_CURRENT and the depth."""
    surface_number: int = quantity(9, title="Surface: mode, command or item", ge=0, le=2**32 - 1)
    """A mode as the heartbeat says it: 9 is SURFACE of ArduSub, 100925440 AUTO.LAND of PX4. As a
    command, 20 returns to where it began, 21 lands."""
    hold_by: Literal["mode", "command"] = quantity("mode", title="Hold by")
    """mode: change to a mode. command: MAV_CMD_DO_PAUSE_CONTINUE."""
    hold_mode: int = quantity(16, title="Mode that holds", ge=0, le=2**32 - 1)
    """16 is POSHOLD of ArduSub, 2 ALT_HOLD; 50593792 is AUTO.LOITER of PX4."""
    resume_mode: int = quantity(3, title="Mode that flies the mission", ge=0, le=2**32 - 1)
    """3 is AUTO of ArduSub, 67371008 AUTO.MISSION of PX4."""
