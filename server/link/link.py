"""What the services ask of the links to the robots."""

from datetime import datetime
from typing import Protocol

from robot_link.camera.fix import CameraFix
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    PlanHash,
    RobotId,
    UploadReport,
)
from robot_link.mission import Mission
from robot_link.station.drive_client import DriveClient
from robot_link.station.fix_sender import OnSent


class Radio(Protocol):
    """The part of ``robot_link.station.link.StationLink`` that services use; see there."""

    async def upload(
        self, robot: RobotId, mission: Mission, *, may_wait: bool = False
    ) -> UploadReport:
        """Put a mission on board; return the last report."""
        ...

    def cancel_upload(self, robot: RobotId, reason: str) -> None:
        """End an upload under way as FAILED."""
        ...

    def send_command(
        self,
        robot: RobotId,
        kind: CommandKind,
        number: CommandNumber,
        expires: datetime,
        plan: PlanHash | None = None,
    ) -> None:
        """Send a command until it is answered or expires."""
        ...

    def send_fix(self, fix: CameraFix, on_sent: OnSent) -> str:
        """Tell a robot where cameras saw it; return why it will not be sent, or ""."""
        ...

    def drive(self, robot: RobotId) -> DriveClient:
        """Return what drives a robot by hand; ServiceError if it is not in radio contact."""
        ...
