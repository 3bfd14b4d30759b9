"""Files on board, listed and downloaded."""

from pathlib import Path

import pytest

from onboard.link.file_server import FileServer
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.file_store import FileEntry, FileStore, FolderFiles, NoFiles
from robot_link.service.file_wire import FileRequest, file_crc32, read_file_request
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.file_client import FileClient
from tests.robot_link.service_pair import HASTY, Wire


def pair(
    files: FileStore, server: FileServer | None = None, **conditions: float
) -> tuple[FileClient, Wire]:
    serving = server or FileServer(files)

    def answer(message: WireMessage) -> list[WireMessage]:
        return [packed(request) for request in serving.hear(message)]

    wire = Wire(answer, **conditions)
    client = FileClient(wire, patience=HASTY)
    wire.client = client.hear
    return client, wire


def packed(request: FileRequest) -> WireMessage:
    return grace.MAVLink_file_transfer_protocol_message(0, 255, 190, request.octets())


@pytest.fixture
def content() -> bytes:
    return bytes((7 * n * n + n // 251) % 256 for n in range(5_123)) + bytes(300)


@pytest.fixture
def folder(tmp_path: Path, content: bytes) -> Path:
    root = tmp_path / "log"
    (root / "old").mkdir(parents=True)
    (root / "dive-1.bin").write_bytes(content)
    (root / "empty.bin").touch()
    for number in range(40):
        (root / "old" / f"dive-{number:04}-with-a-long-name.bin").write_bytes(bytes(number))
    (tmp_path / "secret").write_text("not a log")
    return root


async def test_a_folder_of_many_files_is_listed_whole(folder: Path):
    client, _ = pair(FolderFiles(folder), loss=0.2)
    assert await client.list("/") == (
        FileEntry("dive-1.bin", 5423),
        FileEntry("empty.bin", 0),
        FileEntry("old", 0, is_folder=True),
    )
    old = await client.list("/old")
    assert [entry.size for entry in old] == list(range(40))
    assert old[-1].name == "dive-0039-with-a-long-name.bin"


async def test_a_file_arrives_whole_though_a_third_is_lost(folder: Path, content: bytes):
    client, _ = pair(FolderFiles(folder), loss=0.33, duplication=0.2)
    told: list[tuple[int, int]] = []
    assert await client.download("/dive-1.bin", report=lambda *at: told.append(at)) == content
    assert [received for received, _ in told] == sorted(received for received, _ in told)
    assert told[-1] == (len(content), len(content))
    assert await client.download("/empty.bin") == b""


async def test_an_interrupted_download_goes_on_where_it_stopped(folder: Path, content: bytes):
    client, wire = pair(FolderFiles(folder))

    def cut(received: int, _size: int) -> None:
        wire.is_cut = received >= 2000

    came = bytearray()
    with pytest.raises(NoAnswerError, match="did not answer"):
        await client.download("/dive-1.bin", content=came, report=cut)
    assert came == content[:2000]
    wire.is_cut = False
    wire.asked.clear()
    assert await client.download("/dive-1.bin", content=came) == came == content
    offsets = [asked.offset for asked in reads(wire)]
    assert offsets[0] == 2000


async def test_bytes_of_another_file_are_found_out_and_fetched_anew(folder: Path, content: bytes):
    client, _ = pair(FolderFiles(folder))
    assert await client.download("/dive-1.bin", content=bytearray(b"\1" * 800)) == content


async def test_a_download_outlives_a_restart_of_the_robot(folder: Path, content: bytes):
    servers = [FileServer(FolderFiles(folder)), FileServer(FolderFiles(folder))]

    class Restarting:
        def hear(self, message: WireMessage) -> list[FileRequest]:
            return servers[0].hear(message)

    client, _ = pair(NoFiles(), Restarting())

    def restart(received: int, _size: int) -> None:
        if received >= 1000 and len(servers) == 2:
            servers.pop(0)

    assert await client.download("/dive-1.bin", report=restart) == content
    assert len(servers) == 1


async def test_what_is_appended_during_a_download_belongs_to_the_next(folder: Path, content: bytes):
    client, _ = pair(FolderFiles(folder))

    def append(received: int, _size: int) -> None:
        if received == 400:
            with (folder / "dive-1.bin").open("ab") as log:
                log.write(b"later")

    assert await client.download("/dive-1.bin", report=append) == content
    assert await client.download("/dive-1.bin", content=bytearray(content)) == content + b"later"


async def test_a_file_whose_checksum_stays_wrong_is_not_handed_out(folder: Path):
    serving = FileServer(FolderFiles(folder))

    class Spoiling:
        def hear(self, message: WireMessage) -> list[FileRequest]:
            answers = serving.hear(message)
            for answer in answers:
                if answer.about == grace.MAV_FTP_OPCODE_READFILE and answer.offset == 400:
                    spoiled = bytes((answer.data[0] ^ 1,)) + answer.data[1:]
                    answers = [
                        FileRequest(
                            answer.sequence, answer.opcode, 0, 400, spoiled, about=answer.about
                        )
                    ]
            return answers

    client, _ = pair(NoFiles(), Spoiling())
    with pytest.raises(ServiceRefusedError, match="checksum"):
        await client.download("/dive-1.bin")


@pytest.mark.parametrize("path", ["/none", "/../secret", "/old/../../secret", "/\0", "/old"])
async def test_nothing_outside_the_folder_can_be_named(folder: Path, path: str):
    client, _ = pair(FolderFiles(folder))
    with pytest.raises(ServiceRefusedError, match="no such file"):
        await client.download(path)


async def test_a_robot_without_files_lists_none_and_a_silent_one_is_told_of():
    client, wire = pair(NoFiles())
    assert await client.list("/") == ()
    with pytest.raises(ServiceRefusedError, match="no such file"):
        await client.list("/deep")
    wire.is_cut = True
    with pytest.raises(NoAnswerError):
        await client.list("/")


def test_nothing_can_be_written_and_a_burst_reads_a_file(folder: Path, content: bytes):
    server = FileServer(FolderFiles(folder))

    def ask(opcode: int, **fields: int | bytes) -> list[FileRequest]:
        return server.hear(packed(FileRequest(sequence=10, opcode=opcode, **fields)))

    for opcode in (grace.MAV_FTP_OPCODE_REMOVEFILE, grace.MAV_FTP_OPCODE_CREATEFILE):
        (answer,) = ask(opcode, data=b"/dive-1.bin")
        assert answer.data == bytes((grace.MAV_FTP_ERR_FILEPROTECTED,))
    (unknown,) = ask(99)
    assert unknown.data == bytes((grace.MAV_FTP_ERR_UNKNOWNCOMMAND,))
    (opened,) = ask(grace.MAV_FTP_OPCODE_OPENFILERO, data=b"/dive-1.bin")
    read, offset = b"", 0
    while offset < len(content):
        for answer in ask(
            grace.MAV_FTP_OPCODE_BURSTREADFILE, session=opened.session, offset=offset, size=200
        ):
            if answer.opcode == grace.MAV_FTP_OPCODE_ACK:
                read += answer.data
        offset = len(read)
    assert read == content


def test_too_many_open_files_are_refused_and_a_reset_closes_them(folder: Path):
    server = FileServer(FolderFiles(folder))
    codes = []
    for number in range(6):
        data = b"/empty.bin"
        request = FileRequest(number, grace.MAV_FTP_OPCODE_OPENFILERO, data=data)
        codes.append(server.hear(packed(request))[0].opcode)
    assert codes == [grace.MAV_FTP_OPCODE_ACK] * 4 + [grace.MAV_FTP_OPCODE_NAK] * 2
    server.hear(packed(FileRequest(7, grace.MAV_FTP_OPCODE_RESETSESSION)))
    request = FileRequest(8, grace.MAV_FTP_OPCODE_OPENFILERO, data=b"/empty.bin")
    assert server.hear(packed(request))[0].opcode == grace.MAV_FTP_OPCODE_ACK


def test_the_checksum_is_the_one_that_peers_make():
    """The check value of CRC-32/JAMCRC begun at 0 instead of all ones, by its definition."""
    register = 0
    for octet in b"123456789":
        register ^= octet
        for _ in range(8):
            register = register >> 1 ^ (0xEDB88320 if register & 1 else 0)
    assert file_crc32((b"1234", b"56789")) == register


@pytest.mark.parametrize("cut", [b"", bytes(11), bytes((0, 0, 0, 3, 200, 0, 0, 0, 0, 0, 0, 0, 1))])
def test_a_request_that_is_cut_short_is_no_request(cut: bytes):
    with pytest.raises(ValueError, match="bytes"):
        read_file_request(cut)


def reads(wire: Wire) -> list[FileRequest]:
    asked = [read_file_request(message.payload) for message in wire.asked]
    return [request for request in asked if request.opcode == grace.MAV_FTP_OPCODE_READFILE]
