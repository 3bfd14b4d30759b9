"""What is asked of a file of a deployment: of which rows it is, in what mode, in whose name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from autonomy.channel import Channel
from db.query.fleet.robots import RobotRecord
from db.query.measured.quality import ManualFlag
from robot_link.delivery_config import DeliveryMetadata
from server.delivery.judged import Wanted


@dataclass(frozen=True, slots=True)
class FileOrder:
    """What is to be written."""

    wanted: Wanted
    robot: RobotRecord
    channels: Mapping[str, Channel]
    """Those of the rows, as the station has them."""
    metadata: DeliveryMetadata
    thresholds_m: tuple[float, ...]
    """Of the fidelity levels."""
    manual: Sequence[ManualFlag]
    mode: str
    """R from telemetry, P recovered and not reviewed, D reviewed."""
    signed_by: str
    """Who reviewed the data; empty before."""
    written_at: datetime
    software: str
    """Name and version of what writes."""
    folder: Path
    earlier: str = ""
    """History of the file that was written before, a line for each writing."""
    came_after: int = 0
    """Measurements that came after the deployment was signed: nobody answers for them."""
    pruned: tuple[str, ...] = ()
    """What of the deployment is no longer all there, sentences."""

    @property
    def history(self) -> str:
        """What was done to the data, a line for each writing, the newest last."""
        signed = f", signed by {self.signed_by}" if self.signed_by else ""
        line = (
            f"{self.written_at:%Y-%m-%dT%H:%M:%SZ} {self.software} wrote mode {self.mode}"
            f" of {self.wanted.deployment.id}{signed}"
        )
        return "\n".join(filter(None, (self.earlier, line)))

    @property
    def is_simulated(self) -> bool:
        """Whether the robot exists in a simulator only."""
        return self.robot.simulated

    @property
    def serial(self) -> str:
        """Serial number of the platform, marked where it does not exist."""
        mark = "SIMULATION_" if self.is_simulated else ""
        return mark + (self.metadata.platform_serial_number or self.robot.id)

    @property
    def identity(self) -> str:
        """Global ``id``, and the file's name without its ending."""
        begun = self.wanted.deployment.begun_at
        return f"{self.serial}_{begun:%Y%m%dT%H%M%S}_{self.mode}"
