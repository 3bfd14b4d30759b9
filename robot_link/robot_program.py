"""What the link asks of the program that flies a robot."""

from enum import StrEnum
from typing import Protocol

from robot_link.camera.received_fix import ReceivedFix
from robot_link.drive import DriveReport, Stick
from robot_link.messages import CommandKind
from robot_link.mission import Mission


class CommandOutcome(StrEnum):
    """What the onboard program says to a command."""

    DONE = "done"
    NOT_NOW = "not_now"
    WRONG_PLAN = "wrong_plan"
    """START named a plan that is not on board."""
    UNSUPPORTED = "unsupported"
    IMPLAUSIBLE = "implausible"
    """What a sensor reads cannot be what it was to be taken for."""


class RobotProgram(Protocol):
    """What the link asks of the onboard program; called on the loop, must return at once."""

    def plan_refusal(self) -> str:
        """Return why no new plan can be taken now (such as being under water), or ""."""
        ...

    def take_plan(self, mission: Mission) -> None:
        """Replace the plan on board; the new one waits for START."""
        ...

    @property
    def is_flying(self) -> bool:
        """Whether a plan is flown, and not just given up: another may wait behind it."""
        ...

    def switch_refusal(self, mission: Mission) -> str:
        """Return why a waiting plan could not begin at a surfacing now, or ""."""
        ...

    def switch_plan(self, mission: Mission) -> None:
        """End the plan on board at a surfacing and begin another; it must not be refused."""
        ...

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command; ``plan_digits`` are the first 12 digits of START's plan, else ""."""
        ...

    def begin_drive(self) -> CommandOutcome:
        """Let somebody drive the robot by hand; again while that lasts changes nothing."""
        ...

    def end_drive(self) -> None:
        """Let nobody drive it any more."""
        ...

    def steer(self, stick: Stick) -> None:
        """Take where the pilot's stick is; nothing where nobody drives."""
        ...

    def hear_fix(self, fix: ReceivedFix) -> None:
        """Take where somebody outside saw the robot, or refuse it and count that."""
        ...

    def refuse_fix(self, reason: str) -> None:
        """Count a fix that is none, or is not for this robot; ``reason`` is a sentence."""
        ...

    def drive_report(self, sequence: int) -> DriveReport:
        """Return what becomes of the newest stick, which came in the frame of this number."""
        ...
