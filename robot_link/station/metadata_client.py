"""What a vehicle says of its parameters: the files behind COMPONENT_METADATA, by MAVLink FTP."""

import zlib
from typing import Final
from urllib.parse import urlsplit

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.parameter_file import (
    LARGEST_BYTES,
    ParameterDescription,
    ParameterFileError,
    descriptions,
    parameter_uri,
    unpacked,
)
from robot_link.station.command_client import StandardCommand
from robot_link.station.error import ServiceRefusedError
from robot_link.station.exchange import Correspondent, Exchange, Patience
from robot_link.station.file_client import FileClient

_COMPONENT: Final = grace.MAV_COMP_ID_AUTOPILOT1


class MetadataClient:
    """Belongs to one event loop."""

    def __init__(
        self, peer: Correspondent, files: FileClient, *, patience: Patience | None = None
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._files = files

    def hear(self, message: WireMessage) -> None:
        """Take what the vehicle says."""
        self._exchange.hear(message)

    async def parameters(self) -> dict[str, ParameterDescription]:
        """Return what the vehicle's maker says of its parameters.

        Raises:
            NoAnswerError: If the vehicle fell silent.
            ServiceRefusedError: If it has no such files, or they cannot be read.
        """
        command = StandardCommand(
            grace.MAV_CMD_REQUEST_MESSAGE, (float(grace.MAVLINK_MSG_ID_COMPONENT_METADATA),)
        )
        told = await self._exchange.ask(
            lambda attempt: (command.message(self._exchange.system, _COMPONENT, attempt),),
            _metadata_or_refusal,
            attempts=2,
        )
        if not isinstance(told, grace.MAVLink_component_metadata_message):
            raise ServiceRefusedError("the vehicle does not describe its parameters")
        try:
            general = await self._fetch(told.uri, told.file_crc)
            uri, crc = parameter_uri(unpacked(general))
            return descriptions(await self._fetch(uri, crc))
        except ParameterFileError as error:
            raise ServiceRefusedError(f"the vehicle's description: {error}") from error

    async def _fetch(self, uri: str, crc: int | None) -> bytes:
        """Return a file on board; one on the Internet is not asked for: a boat has none."""
        parts = urlsplit(uri)
        if parts.scheme != "mftp" or parts.netloc or parts.query:
            raise ServiceRefusedError(f"its description is not on board: {uri[:80]}")
        content = bytearray()

        def watch(_received: int, size: int) -> None:
            if size > LARGEST_BYTES:
                raise ServiceRefusedError(f"{parts.path}: larger than {LARGEST_BYTES >> 20} MB")

        fetched = await self._files.download(parts.path, content=content, report=watch)
        if crc and zlib.crc32(fetched) != crc:
            raise ServiceRefusedError(f"{parts.path}: its checksum is not the one that was told")
        return fetched


def _metadata_or_refusal(
    message: WireMessage,
) -> grace.MAVLink_component_metadata_message | bool | None:
    match message:
        case grace.MAVLink_component_metadata_message():
            return message
        case grace.MAVLink_command_ack_message(command=grace.MAV_CMD_REQUEST_MESSAGE):
            return None if message.result == grace.MAV_RESULT_ACCEPTED else False
        case _:
            return None
