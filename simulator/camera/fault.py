"""What somebody may do to emulated cameras and their tank at the fault desk."""

import math
from collections.abc import Callable, Mapping

from robot_link.clock import Clock
from simulator.camera.tank import EmulatedTank
from simulator.fault import FaultKind

TANK_NAME = "tank"
"""What the desk calls the tank; cameras go by their own names."""
BUMP_TURN_DEG = (0.4, -0.3, 0.2)
BUMP_SHIFT_NED_M = (0.006, -0.004, 0.002)
LEVEL_FALL_M = 0.03
RIPPLE_SLOPE_RAD = math.radians(0.5)

CAMERA_FAULTS: Mapping[str, FaultKind] = {
    "bump": FaultKind(
        "", "Bumped camera", "somebody bumps into the camera", "the camera hangs as it did"
    ),
    "frozen": FaultKind(
        "", "Frozen picture", "the camera sends the same picture again and again", "pictures go on"
    ),
    "cut": FaultKind("", "Cut stream", "the camera hangs up and takes no call", "it takes calls"),
    "silent": FaultKind("", "Silent camera", "the camera sends no more pictures", "it sends again"),
    "board": FaultKind(
        "",
        "Board in front of it",
        "somebody holds the board for lenses before the camera, every two seconds elsewhere",
        "the board is put away",
    ),
}
TANK_FAULTS: Mapping[str, FaultKind] = {
    "level": FaultKind("", "Lower level", "the water falls by 3 cm", "the level is as it was"),
    "ripples": FaultKind(
        "", "Ripples", "ripples of 0.5 deg run over the water", "the water is calm"
    ),
    "dark": FaultKind("", "Light off", "the light goes out", "the light is on"),
}


class FaultyPart:
    """A camera or the tank, with which something may go wrong. Belongs to one event loop.

    Args:
        clock: The robots' time.
        kinds: What may be wrong with it.
        put: Told of each fault as it begins and as it is undone.
    """

    def __init__(
        self, clock: Clock, kinds: Mapping[str, FaultKind], put: Callable[[str, bool], None]
    ) -> None:
        self.fault_kinds = kinds
        self.is_in_reach_of_hands = True
        self._clock, self._put = clock, put
        self._born = clock.now()
        self._began: dict[str, float] = {}

    @property
    def lived_s(self) -> float:
        """Seconds since it is there."""
        return (self._clock.now() - self._born).total_seconds()

    def begin_s(self, name: str) -> float:
        """Return when a fault came, of its life; infinity if it did not."""
        return self._began.get(name, math.inf)

    def cause(self, name: str) -> None:
        """Let a fault come now."""
        self._began[name] = self.lived_s
        self._put(name, True)

    def mend(self, name: str) -> None:
        """Undo a fault."""
        self._began.pop(name, None)
        self._put(name, False)


def faulty_camera(tank: EmulatedTank, camera: str) -> FaultyPart:
    """Return one camera of a tank as the desk meets it."""
    still = (0.0, 0.0, 0.0)

    def put(name: str, is_caused: bool) -> None:
        changes: Mapping[str, Mapping[str, object]] = {
            "bump": {
                "turn_deg": BUMP_TURN_DEG if is_caused else still,
                "shift_ned_m": BUMP_SHIFT_NED_M if is_caused else still,
            },
            "frozen": {"is_frozen": is_caused},
            "cut": {"is_cut": is_caused},
            "silent": {"is_silent": is_caused},
            "board": {"board_since": tank.clock.now() if is_caused else None},
        }
        tank.trouble_with(camera, **changes[name])

    return FaultyPart(tank.clock, CAMERA_FAULTS, put)


def faulty_tank(tank: EmulatedTank) -> FaultyPart:
    """Return the water and the light of a tank as the desk meets them."""
    usual = tank.scene

    def put(name: str, is_caused: bool) -> None:
        if name == "level":
            tank.set_water(level_m=usual.level_m + (LEVEL_FALL_M if is_caused else 0.0))
        elif name == "ripples":
            slope = RIPPLE_SLOPE_RAD if is_caused else usual.ripple_slope_rad
            tank.set_water(ripple_slope_rad=slope)
        else:
            tank.set_brightness(0.0 if is_caused else usual.lighting.brightness)

    return FaultyPart(tank.clock, TANK_FAULTS, put)
