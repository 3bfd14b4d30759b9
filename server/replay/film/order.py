"""What is asked of a film, and what comes of it."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final, Literal

from autonomy.channel import ChannelCatalogue
from autonomy.vehicle.hull import Hull
from db.query.fleet.robots import RobotRecord
from server.scene.replay_source import Clock

Kind = Literal["page", "viser", "pictures"]
"""A page of HTML that plays by itself, the same for viser's player, or PNG pictures in a ZIP."""
ENDINGS: Final[dict[Kind, str]] = {"page": ".html", "viser": ".viser", "pictures": ".zip"}
FRAMES_PER_S: Final = 10
PART: Final = ".part"
"""Marks what is not whole yet."""


@dataclass(frozen=True, slots=True)
class FilmOrder:
    """What is to be drawn of a robot's past."""

    id: str
    robot: RobotRecord
    first: datetime
    last: datetime
    clock: Clock
    kind: Kind
    lasts_s: int
    """Length of the film; the stretch runs so much faster."""
    made_at: datetime
    database_url: str
    folder: Path
    """Of this robot's films."""
    hull: Hull
    thresholds_m: tuple[float, ...]
    channels: ChannelCatalogue

    @property
    def name(self) -> str:
        """Name of the file; a robot that does not exist says so in it."""
        mark = "SIMULATION_" if self.robot.simulated else ""
        times = f"{self.first:%Y%m%dT%H%M%S}_{self.last:%Y%m%dT%H%M%S}"
        return f"{mark}{self.robot.id}_{times}_{self.kind}{ENDINGS[self.kind]}"

    @property
    def words(self) -> str:
        """What stands on every picture of it."""
        mark = "SIMULATION, this robot does not exist. " if self.robot.simulated else ""
        times = f"{self.first:%Y-%m-%d %H:%M:%S}Z to {self.last:%Y-%m-%d %H:%M:%S}Z"
        what = "as it was measured" if self.clock == "measured" else "as the station heard it"
        return f"{mark}{self.robot.name}, {times}, {what}; not live"

    @property
    def frames(self) -> int:
        """How many moments are drawn."""
        return self.lasts_s * FRAMES_PER_S + 1

    def moments(self) -> Generator[datetime]:
        """Yield the moments that are drawn, at even steps from the first to the last."""
        step = (self.last - self.first) / (self.frames - 1)
        for number in range(self.frames):
            yield self.first + number * step


@dataclass(frozen=True, slots=True)
class KeptFilm:
    """A film that is kept."""

    id: str
    name: str
    sha256: str
    bytes: int
