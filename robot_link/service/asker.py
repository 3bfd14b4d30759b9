"""One ground station as a robot sees it, and what it may ask for."""

from dataclasses import dataclass, field

from robot_link.messages import SystemId
from robot_link.service.file_server import FileServer
from robot_link.service.mission_server import Asker, MissionServer
from robot_link.service.parameter_server import ParameterServer
from robot_link.service.stream import Streams
from robot_link.transport.datagram import Address


@dataclass(slots=True)
class AskerServices:
    """What is kept for one ground station while it is heard."""

    asker: Asker
    address: Address
    """Its radio."""
    heard_s: float
    parameters: ParameterServer
    files: FileServer
    missions: MissionServer
    streams: Streams = field(default_factory=Streams)

    @property
    def system(self) -> SystemId:
        """Its system id."""
        return self.asker.system
