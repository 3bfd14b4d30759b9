"""A robot's files, read by MAVLink FTP; nothing can be written or removed."""

from collections.abc import Iterator
from dataclasses import dataclass

from robot_link.mavlink.wire import grace
from robot_link.service.file_store import FileStore
from robot_link.service.file_wire import (
    MAX_DATA,
    FileRequest,
    file_crc32,
    listing,
    read_file_request,
)

_SESSIONS = 4
_CHUNK_BYTES = 65536
_BURST = 16
"""Answers to one burst question; the asker then asks for more."""
_WRITING = frozenset(
    (
        grace.MAV_FTP_OPCODE_CREATEFILE,
        grace.MAV_FTP_OPCODE_WRITEFILE,
        grace.MAV_FTP_OPCODE_REMOVEFILE,
        grace.MAV_FTP_OPCODE_CREATEDIRECTORY,
        grace.MAV_FTP_OPCODE_REMOVEDIRECTORY,
        grace.MAV_FTP_OPCODE_OPENFILEWO,
        grace.MAV_FTP_OPCODE_TRUNCATEFILE,
        grace.MAV_FTP_OPCODE_RENAME,
    )
)


@dataclass(frozen=True, slots=True)
class _Opened:
    path: str
    size: int
    """Bytes when it was opened: what is appended later does not belong to this download."""


class _FileError(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class FileServer:
    """Answers one asker. A question that is repeated is answered again and opens nothing twice."""

    def __init__(self, files: FileStore) -> None:
        self._files = files
        self._opened: dict[int, _Opened] = {}
        self._last: tuple[FileRequest, FileRequest] | None = None

    def hear(self, message: grace.MAVLink_file_transfer_protocol_message) -> list[FileRequest]:
        """Return the answers; none to what is no question."""
        try:
            asked = read_file_request(message.payload)
        except ValueError:
            return []
        if asked.opcode in (grace.MAV_FTP_OPCODE_ACK, grace.MAV_FTP_OPCODE_NAK):
            return []
        if self._last is not None and asked == self._last[0]:
            return [self._last[1]]
        if asked.opcode == grace.MAV_FTP_OPCODE_BURSTREADFILE:
            return self._burst(asked)
        answer = self._answer(asked)
        self._last = (asked, answer)
        return [answer]

    def _answer(self, asked: FileRequest) -> FileRequest:
        try:
            match asked.opcode:
                case grace.MAV_FTP_OPCODE_NONE:
                    return _acknowledged(asked)
                case grace.MAV_FTP_OPCODE_TERMINATESESSION:
                    self._opened.pop(asked.session, None)
                    return _acknowledged(asked)
                case grace.MAV_FTP_OPCODE_RESETSESSION:
                    self._opened.clear()
                    return _acknowledged(asked)
                case grace.MAV_FTP_OPCODE_LISTDIRECTORY:
                    return self._list(asked)
                case grace.MAV_FTP_OPCODE_OPENFILERO:
                    return self._open(asked)
                case grace.MAV_FTP_OPCODE_READFILE:
                    return _acknowledged(asked, self._read(asked, asked.offset), asked.offset)
                case grace.MAV_FTP_OPCODE_CALCFILECRC:
                    crc = file_crc32(self._chunks(_path(asked)))
                    return _acknowledged(asked, crc.to_bytes(4, "little"))
                case opcode if opcode in _WRITING:
                    return _refused(asked, grace.MAV_FTP_ERR_FILEPROTECTED)
                case _:
                    return _refused(asked, grace.MAV_FTP_ERR_UNKNOWNCOMMAND)
        except _FileError as error:
            return _refused(asked, error.code)
        except FileNotFoundError:
            return _refused(asked, grace.MAV_FTP_ERR_FILENOTFOUND)
        except OSError:
            return _refused(asked, grace.MAV_FTP_ERR_FAIL)

    def _list(self, asked: FileRequest) -> FileRequest:
        entries = self._files.list(_path(asked))
        data, count = listing(entries[asked.offset :])
        if not count:
            raise _FileError(grace.MAV_FTP_ERR_EOF)
        return _acknowledged(asked, data, asked.offset)

    def _open(self, asked: FileRequest) -> FileRequest:
        path = _path(asked)
        opened = _Opened(path, self._files.size(path))
        free = [number for number in range(_SESSIONS) if number not in self._opened]
        if not free:
            raise _FileError(grace.MAV_FTP_ERR_NOSESSIONSAVAILABLE)
        self._opened[free[0]] = opened
        size = min(opened.size, 2**32 - 1).to_bytes(4, "little")
        return _acknowledged(asked, size, session=free[0])

    def _read(self, asked: FileRequest, offset: int) -> bytes:
        opened = self._opened.get(asked.session)
        if opened is None:
            raise _FileError(grace.MAV_FTP_ERR_INVALIDSESSION)
        count = min(asked.size or MAX_DATA, MAX_DATA, opened.size - offset)
        if count <= 0:
            raise _FileError(grace.MAV_FTP_ERR_EOF)
        data = self._files.read(opened.path, offset, count)
        if not data:
            raise _FileError(grace.MAV_FTP_ERR_EOF)
        return data

    def _burst(self, asked: FileRequest) -> list[FileRequest]:
        answers: list[FileRequest] = []
        offset, sequence = asked.offset, asked.sequence
        try:
            for number in range(_BURST):
                data = self._read(asked, offset)
                answers.append(
                    FileRequest(
                        sequence=sequence + 1,
                        opcode=grace.MAV_FTP_OPCODE_ACK,
                        session=asked.session,
                        offset=offset,
                        data=data,
                        about=asked.opcode,
                        burst_complete=number == _BURST - 1,
                    )
                )
                offset, sequence = offset + len(data), sequence + 1
        except _FileError as error:
            answers.append(_refused(asked, error.code, sequence + 1))
        except OSError:
            answers.append(_refused(asked, grace.MAV_FTP_ERR_FAIL, sequence + 1))
        return answers

    def _chunks(self, path: str) -> Iterator[bytes]:
        """Yield a file's bytes, as far as they belong to the download under way."""
        sizes = [opened.size for opened in self._opened.values() if opened.path == path]
        end = max(sizes) if sizes else self._files.size(path)
        offset = 0
        while offset < end:
            chunk = self._files.read(path, offset, min(_CHUNK_BYTES, end - offset))
            if not chunk:
                return
            yield chunk
            offset += len(chunk)


def _path(asked: FileRequest) -> str:
    return asked.data.split(b"\0", 1)[0].decode("utf-8", errors="replace")


def _acknowledged(
    asked: FileRequest, data: bytes = b"", offset: int = 0, session: int | None = None
) -> FileRequest:
    return FileRequest(
        sequence=asked.next_sequence,
        opcode=grace.MAV_FTP_OPCODE_ACK,
        session=asked.session if session is None else session,
        offset=offset,
        data=data,
        about=asked.opcode,
    )


def _refused(asked: FileRequest, code: int, sequence: int | None = None) -> FileRequest:
    return FileRequest(
        sequence=asked.next_sequence if sequence is None else sequence,
        opcode=grace.MAV_FTP_OPCODE_NAK,
        session=asked.session,
        data=bytes((code,)),
        about=asked.opcode,
    )
