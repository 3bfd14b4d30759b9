"""What fixes by cameras tell the other capabilities."""

from dataclasses import dataclass

from robot_link.camera.fix import CameraFix


@dataclass(frozen=True, slots=True)
class FixFound:
    """Cameras found a robot, or refused what they saw; told at most five times a second.

    It is on its way to the database.
    """

    fix: CameraFix


@dataclass(frozen=True, slots=True)
class FixesStored:
    """Fixes of a robot are in the database."""

    robot: str
