"""A robot's files, listed and downloaded by MAVLink FTP, question by question.

pymavlink's own client is not used: against MAVSDK's server its downloads stall.
"""

import asyncio
from collections.abc import AsyncIterator, Callable

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.file_store import FileEntry
from robot_link.service.file_wire import (
    MAX_DATA,
    FileRequest,
    file_crc32,
    read_file_request,
    read_listing,
)
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.exchange import Correspondent, Exchange, Patience

_REASONS = {
    grace.MAV_FTP_ERR_FILENOTFOUND: "there is no such file on board",
    grace.MAV_FTP_ERR_NOSESSIONSAVAILABLE: "too many files are open on board",
    grace.MAV_FTP_ERR_FILEPROTECTED: "the robot does not let this file be read",
    grace.MAV_FTP_ERR_UNKNOWNCOMMAND: "the robot does not know how to do this",
}
_LONGEST_LISTING = 10_000
_OPENINGS = 3
"""How often a file is opened again that the robot closed on its own."""


class FileClient:
    """One use at a time; belongs to one event loop."""

    def __init__(
        self,
        peer: Correspondent,
        *,
        component: int = grace.MAV_COMP_ID_AUTOPILOT1,
        patience: Patience | None = None,
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._component = component
        self._sequence = 0
        self._in_use = asyncio.Lock()

    def hear(self, message: WireMessage) -> None:
        """Take what the robot says."""
        self._exchange.hear(message)

    async def list(self, path: str = "/") -> tuple[FileEntry, ...]:
        """Return the entries of a folder on board.

        Raises:
            ServiceError: If the robot does not answer or has no such folder.
        """
        entries: list[FileEntry] = []
        place = 0
        async with self._in_use:
            while place < _LONGEST_LISTING:
                answer = await self._ask(
                    grace.MAV_FTP_OPCODE_LISTDIRECTORY, data=path.encode(), offset=place
                )
                if _error_of(answer) == grace.MAV_FTP_ERR_EOF:
                    break
                found, places = read_listing(_accepted(answer, path).data)
                if not places:
                    break
                entries += [entry for entry in found if entry.name not in (".", "..")]
                place += places
        return tuple(entries)

    async def download(
        self,
        path: str,
        *,
        content: bytearray | None = None,
        report: Callable[[int, int], None] = lambda _received, _size: None,
    ) -> bytes:
        """Return a whole file, proved by the checksum that the robot makes of its own.

        Args:
            path: The file, as its folder's listing names it.
            content: Its first bytes, from a download that broke off; grows as the file comes, so
                that it holds what is there however this one ends.
            report: Called after each piece with the bytes that are there, and the file's size.

        Raises:
            NoAnswerError: If the robot fell silent.
            ServiceRefusedError: If there is no such file, or the checksum stays wrong.
        """
        data = bytearray() if content is None else content
        async with self._in_use:
            is_anew = not data
            while not await self._is_proved(path, await self._fetched(path, data, report), data):
                if is_anew:
                    reason = f"{path}: the checksum is not that of the file on board"
                    raise ServiceRefusedError(reason)
                data.clear()
                is_anew = True
        return bytes(data)

    async def _fetched(self, path: str, data: bytearray, report: Callable[[int, int], None]) -> int:
        """Complete a file; return the session that is open."""
        for _ in range(_OPENINGS):
            session, size = await self._open(path)
            if len(data) > size:
                data.clear()
            try:
                async for piece in self._pieces(path, session, len(data), size):
                    data += piece
                    report(len(data), size)
            except _SessionLostError:
                continue
            return session
        raise NoAnswerError(f"{path}: the robot keeps closing the file")

    async def _open(self, path: str) -> tuple[int, int]:
        """Return the session and the size of the file."""
        answer = await self._ask(grace.MAV_FTP_OPCODE_OPENFILERO, data=path.encode())
        opened = _accepted(answer, path)
        return opened.session, int.from_bytes(opened.data[:4], "little")

    async def _pieces(
        self, path: str, session: int, offset: int, size: int
    ) -> AsyncIterator[bytes]:
        while offset < size:
            answer = await self._ask(
                grace.MAV_FTP_OPCODE_READFILE,
                session=session,
                offset=offset,
                size=min(MAX_DATA, size - offset),
            )
            match _error_of(answer):
                case grace.MAV_FTP_ERR_EOF:
                    return
                case grace.MAV_FTP_ERR_INVALIDSESSION:
                    raise _SessionLostError
                case _:
                    piece = _accepted(answer, path).data
            if not piece:
                raise ServiceRefusedError(f"{path}: the robot sent an empty piece of the file")
            yield piece
            offset += len(piece)

    async def _is_proved(self, path: str, session: int, data: bytearray) -> bool:
        """Compare checksums, then close the file."""
        answer = await self._ask(grace.MAV_FTP_OPCODE_CALCFILECRC, data=path.encode())
        await self._ask(grace.MAV_FTP_OPCODE_TERMINATESESSION, session=session)
        crc = _accepted(answer, path).data[:4]
        return int.from_bytes(crc, "little") == file_crc32((data,))

    async def _ask(
        self, opcode: int, *, session: int = 0, offset: int = 0, data: bytes = b"", size: int = 0
    ) -> FileRequest:
        self._sequence = (self._sequence + 2) % 2**16
        request = FileRequest(self._sequence, opcode, session, offset, data, size)
        message = grace.MAVLink_file_transfer_protocol_message(
            target_network=0,
            target_system=self._exchange.system,
            target_component=self._component,
            payload=request.octets(),
        )
        return await self._exchange.ask(
            lambda _: (message,), lambda heard: _answer_to(request, heard)
        )


class _SessionLostError(Exception):
    """The robot forgot that the file is open, such as by a restart."""


def _accepted(answer: FileRequest, path: str) -> FileRequest:
    code = _error_of(answer)
    if code is not None:
        reason = _REASONS.get(code, "the robot cannot read this")
        raise ServiceRefusedError(f"{path}: {reason}")
    return answer


def _answer_to(request: FileRequest, message: WireMessage) -> FileRequest | None:
    if not isinstance(message, grace.MAVLink_file_transfer_protocol_message):
        return None
    try:
        answer = read_file_request(message.payload)
    except ValueError:
        return None
    is_answer = answer.sequence == request.next_sequence and answer.about == request.opcode
    return answer if is_answer else None


def _error_of(answer: FileRequest) -> int | None:
    if answer.opcode != grace.MAV_FTP_OPCODE_NAK:
        return None
    return answer.data[0] if answer.data else grace.MAV_FTP_ERR_FAIL
