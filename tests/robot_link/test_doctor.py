"""The doctor says in plain words what a link brings, and what to try."""

import asyncio
import math
import os
import random
import socket
import termios
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from autonomy.site import TANK
from db.query.fleet.robots import RobotRecord, add_robot
from db.store import Store
from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.signing import MemorySigningMemory, Signing
from robot_link.messages import RobotId, RobotMode, SystemId
from robot_link.service.heartbeat import robot_heartbeat
from robot_link.transport import doctor
from robot_link.transport.advice import byte_advice, port_advice
from robot_link.transport.datagram import BROADCAST, Address, PortClosedError
from robot_link.transport.doctor import Doctor
from robot_link.transport.opening import open_transport
from robot_link.transport.port import SerialPort
from robot_link.transport.uri import LinkUri
from robot_link.transport.xbee_frame import ReceivePacket, encode
from server.base.secret import GatewayAccount, SecretStore
from server.base.settings import Settings
from server.cli.main import main
from server.link import examination
from simulator.acoustic_modem import AcousticConditions, AcousticModem
from simulator.xbee_network import AirConditions, XBeeNetwork
from tests.free_port import free_port
from tests.robot_link.far_end import heartbeat, line, running
from tests.tcp_peer import serving

STATION = Address(0x0013A200_41F000FF)
LISTEN_S = 0.4


async def examined(uri: str, listen_s: float = LISTEN_S) -> tuple[bool, str]:
    said: list[str] = []
    is_well = await Doctor(uri, said.append).examine(listen_s)
    return is_well, "\n".join(said)


async def told(uri: str, *words: str, listen_s: float = LISTEN_S) -> tuple[bool, str]:
    """Listen again and longer where a busy machine had no time to hear."""
    for patience in (1, 2, 4, 8, 16):
        is_well, said = await examined(uri, patience * listen_s)
        if all(one in said for one in words):
            break
    return is_well, said


async def repeating(say: Callable[[], object], every_s: float = 0.02) -> None:
    while True:
        say()
        await asyncio.sleep(every_s)


class Speaking:
    """Says something again and again while the context lasts."""

    def __init__(self, say: Callable[[], object]) -> None:
        self._say = say

    async def __aenter__(self) -> None:
        self._task = asyncio.create_task(repeating(self._say))

    async def __aexit__(self, *_: object) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)


async def test_robots_of_an_xbee_network_are_named_with_radio_and_strength(tmp_path: Path):
    air = XBeeNetwork(random.Random(1), AirConditions(), discovery_s=0.2)
    radios = {system: air.robot_radio(Address(0x0013A200_41F00000 + system)) for system in (1, 2)}
    tasks = [
        asyncio.create_task(talk(radio, Codec(SystemId(system), ROBOT_COMPONENT)))
        for system, radio in radios.items()
    ]
    try:
        async with air.pty(STATION, tmp_path / "xbee"):
            is_well, said = await told(
                f"xbee://{tmp_path}/xbee", "System 1 is", "System 2 is", "(ROBOT 0001) answers"
            )
    finally:
        for task in tasks:
            task.cancel()
    assert is_well
    assert "The XBee 0013A20041F000FF answers; one packet carries 256 bytes" in said
    assert "The radio 0013A20041F00001 (ROBOT 0001) answers at -52 dBm." in said
    assert "System 2 is heard from the radio 0013A20041F00002" in said
    assert "HEARTBEAT" in said


async def talk(radio, codec: Codec) -> None:
    while True:
        await radio.send(BROADCAST, heartbeat(1, codec))
        await asyncio.sleep(0.02)


async def test_a_brief_look_at_a_robot_that_speaks_ends_soon_and_waits_for_no_neighbours(
    tmp_path: Path,
):
    air = XBeeNetwork(random.Random(1), AirConditions(), discovery_s=600.0)
    radio = air.robot_radio(Address(0x0013A200_41F00001))
    task = asyncio.create_task(talk(radio, Codec(SystemId(1), ROBOT_COMPONENT)))
    said: list[str] = []
    try:
        async with air.pty(STATION, tmp_path / "xbee"), asyncio.timeout(50.0):
            doctor = Doctor(f"xbee://{tmp_path}/xbee", said.append, is_brief=True)
            assert await doctor.examine(600.0)
    finally:
        task.cancel()
    assert any("System 1 is heard" in line for line in said)


async def test_two_radios_that_speak_as_one_system_are_told(tmp_path: Path):
    air = XBeeNetwork(random.Random(1), AirConditions(), discovery_s=0.2)
    radios = [air.robot_radio(Address(0x0013A200_41F00000 + n)) for n in (1, 2)]
    tasks = [
        asyncio.create_task(talk(radio, Codec(SystemId(7), ROBOT_COMPONENT))) for radio in radios
    ]
    try:
        async with air.pty(STATION, tmp_path / "xbee"):
            is_well, said = await told(f"xbee://{tmp_path}/xbee", "both speak")
    finally:
        for task in tasks:
            task.cancel()
    assert not is_well
    assert "0013A20041F00001 and 0013A20041F00002 both speak as system 7" in said
    assert "another MAVLink system id" in said


async def test_an_xbee_that_answers_alone_is_no_robot(tmp_path: Path):
    air = XBeeNetwork(random.Random(1), AirConditions(), discovery_s=0.2)
    async with air.pty(STATION, tmp_path / "xbee"):
        is_well, said = await told(f"xbee://{tmp_path}/xbee", "No other radio")
    assert not is_well
    assert "No other radio of its network answers." in said
    assert "Nothing was heard." in said
    assert "above the water" in said


async def test_a_radio_that_answers_for_a_silent_robot_is_told(tmp_path: Path):
    air = XBeeNetwork(random.Random(1), AirConditions(), discovery_s=0.1)
    air.robot_radio(Address(0x0013A200_41F00001), "mini-1")
    async with air.pty(STATION, tmp_path / "xbee"):
        is_well, said = await told(f"xbee://{tmp_path}/xbee", "(mini-1) answers")
    assert not is_well
    assert "(mini-1) answers" in said
    assert "no robot says anything" in said


async def test_the_wrong_api_mode_is_told(tmp_path: Path):
    air = XBeeNetwork(random.Random(1), AirConditions())
    async with air.pty(STATION, tmp_path / "xbee", 2):
        is_well, said = await told(f"xbee://{tmp_path}/xbee?ap=1", "API mode 2")
    assert not is_well
    assert "API mode 2" in said
    assert "ap=2" in said


async def test_a_vehicle_on_a_line_is_heard(tmp_path: Path):
    with line(tmp_path / "line") as far:
        async with Speaking(lambda: far.write(heartbeat(3))):
            is_well, said = await told(f"serial://{tmp_path}/line", "is heard")
    assert is_well
    assert "System 1 is heard:" in said


async def test_an_xbee_taken_for_a_plain_line_is_told(tmp_path: Path):
    packet = encode(ReceivePacket(Address(5), heartbeat(1)).content(), 1)
    with line(tmp_path / "line") as far:
        async with Speaking(lambda: far.write(packet)):
            is_well, said = await told(f"serial://{tmp_path}/line", "API mode 1")
    assert not is_well
    assert "An XBee in API mode 1 is at the port." in said
    assert "xbee:// instead of serial://" in said


async def test_the_right_speed_of_a_line_is_found(tmp_path: Path):
    """The far end speaks at 9600 baud: at any other speed its bytes come out as garbage."""
    rng = random.Random(2)
    with line(tmp_path / "line") as far:

        def speak() -> None:
            speed = termios.tcgetattr(far.descriptor)[5]
            far.write(heartbeat(1) if speed == termios.B9600 else rng.randbytes(20))

        async with Speaking(speak):
            uri = f"serial://{tmp_path}/line?baud=57600"
            is_well, said = await told(uri, "it makes sense", listen_s=0.3)
    assert not is_well
    assert "no MAVLink frame" in said
    assert "At 9600 baud it makes sense: write baud=9600" in said


async def test_garbage_at_every_speed_is_told_as_such(tmp_path: Path):
    rng = random.Random(3)
    with line(tmp_path / "line") as far:
        async with Speaking(lambda: far.write(rng.randbytes(30))):
            is_well, said = await told(f"serial://{tmp_path}/line", "no usual speed", listen_s=0.1)
    assert not is_well
    assert "At no usual speed" in said


async def test_a_line_that_another_program_has_is_told(tmp_path: Path):
    with line(tmp_path / "line"):
        other = await SerialPort.open(str(tmp_path / "line"), baud=57600, flow_control=False)
        try:
            is_well, said = await told(f"serial://{tmp_path}/line", "Another program")
        finally:
            other.close()
    assert not is_well
    assert "Another program has" in said
    assert "fuser" in said


async def test_a_line_that_is_not_there_is_told(tmp_path: Path):
    is_well, said = await told(f"serial://{tmp_path}/line", "There is no")
    assert not is_well
    assert f"There is no line {tmp_path}/line." in said
    os.symlink("/dev/pts/none", tmp_path / "line")
    _, said = await told(f"serial://{tmp_path}/line", "leads nowhere")
    assert "leads nowhere" in said


@pytest.mark.parametrize(
    ("lasts_s", "sentence"),
    [(0.3, "another speed is wanted"), (math.inf, "neither opened nor refused within 0.5 s")],
)
async def test_a_line_that_is_slow_to_refuse_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, lasts_s: float, sentence: str
):
    async def refuse(path: str, **_: object) -> SerialPort:
        await asyncio.sleep(min(lasts_s, 3600.0))
        raise OSError(f"{path}: another speed is wanted")

    monkeypatch.setattr(SerialPort, "open", refuse)
    if math.isinf(lasts_s):
        monkeypatch.setattr(doctor, "_UNDECIDED_S", 0.45)
    is_well, said = await examined("serial:///dev/slow", listen_s=0.05)
    assert not is_well
    assert sentence in said
    assert "None" not in said


async def test_a_network_link_that_nobody_serves_is_told():
    port = free_port()
    is_well, said = await told(f"tcp://127.0.0.1:{port}", "Nobody listens")
    assert not is_well
    assert f"Nobody listens at 127.0.0.1 port {port}." in said
    is_well, said = await examined(f"tcp://127.0.0.1:{port}?listen=1")
    assert not is_well
    assert f"Nobody called at port {port}." in said
    is_well, said = await told(f"udp://127.0.0.1:{port}", "refused")
    assert not is_well
    assert "Connection refused" in said


async def test_a_vehicle_that_waits_to_be_called_is_heard():
    """Many vehicles speak UDP only with a ground station that has spoken first."""
    port = free_port(socket.SOCK_DGRAM)
    robot = open_transport(f"udp://127.0.0.1:{port}?listen=1")
    async with running(robot):
        task = asyncio.create_task(answer(robot))
        is_well, said = await told(f"udp://127.0.0.1:{port}", "is heard")
        task.cancel()
    assert is_well
    assert "System 1 is heard" in said


@pytest.mark.parametrize("signs", [(True,), (False,), (True, False)])
async def test_it_is_told_who_signs_and_who_speaks_without_the_key(signs: tuple[bool, ...]):
    def codec(is_signed: bool) -> Codec:
        key = Signing(bytes(32), MemorySigningMemory(), SystemClock()) if is_signed else None
        return Codec(SystemId(2), ROBOT_COMPONENT, key)

    async def speak(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for one in map(codec, signs):
            writer.write(one.pack(robot_heartbeat(RobotMode.IDLE)))
        await reader.read()

    async with serving(speak) as port:
        is_well, said = await told(f"tcp://127.0.0.1:{port}", "is heard")
    if signs == (True, False):
        assert not is_well
        assert "Frames of system 2 come signed and unsigned" in said
    else:
        assert is_well
        assert ("System 2 signs its frames" in said) == signs[0]
        assert ("System 2 does not sign its frames" in said) != signs[0]


async def answer(robot) -> None:
    async for _ in robot.events():
        try:
            await robot.send(BROADCAST, heartbeat(1))
        except PortClosedError:
            return


@pytest.mark.parametrize(
    ("reason", "sentence"),
    [
        ("[Errno 13] could not open port: Permission denied", "may not use /dev/ttyS9"),
        ("[Errno 11] Could not exclusively lock port", "Another program has /dev/ttyS9 open"),
        ("[Errno 5] Input/output error", "The port does not open: [Errno 5]"),
    ],
)
def test_what_the_system_says_of_a_port_becomes_a_sentence(reason: str, sentence: str):
    assert sentence in port_advice(LinkUri("serial:///dev/ttyS9"), reason).found


def test_a_host_without_an_address_is_told():
    reason = "glider.invalid has no address: Name or service not known"
    advice = port_advice(LinkUri("tcp://glider.invalid:5760"), reason)
    assert any("Write glider.invalid correctly" in one for one in advice.tries)


@pytest.mark.parametrize(
    ("uri", "data", "sentence"),
    [
        ("serial:///dev/x", b"\xfe\x09\x00\x01\x01\x00" + bytes(11) + b"\xfe\x09", "MAVLink 1"),
        ("serial:///dev/x", b"$GPGGA,123519,4807.038,N*47\r\n", "Text comes from the port"),
        ("serial:///dev/x", encode(b"\x8a\x00", 2), "An XBee in API mode"),
        ("xbee:///dev/x", heartbeat(1) + heartbeat(2), "Plain MAVLink comes from the port"),
        ("tcp://127.0.0.1:1", bytes(range(0x80, 0xC0)), "no MAVLink frame"),
    ],
)
def test_strange_bytes_are_recognized(uri: str, data: bytes, sentence: str):
    assert sentence in byte_advice(LinkUri(uri), data).found


def test_no_bytes_however_strange_do_harm():
    rng = random.Random(4)
    for uri in ("serial:///dev/x", "xbee:///dev/x", "udp://127.0.0.1:1"):
        for _ in range(300):
            assert byte_advice(LinkUri(uri), rng.randbytes(rng.randrange(200))).found


def test_the_command_line_examines_a_link_and_tells_by_its_exit_status(capsys):
    assert main(["link", "doctor", "serial:///dev/no-such-line", "--seconds", "1"]) == 1
    assert "There is no line /dev/no-such-line." in capsys.readouterr().out
    assert main(["link", "doctor", "serial://", "--seconds", "1"]) == 2
    assert "needs the path" in capsys.readouterr().err
    assert main(["link", "doctor", "rockblock://3002340107533"]) == 2
    assert "an IMEI has 15 digits" in capsys.readouterr().err
    assert main(["link", "doctor", "udp://127.0.0.1:1", "--seconds", "-1"]) == 2
    assert "--seconds" in capsys.readouterr().err


@pytest.mark.parametrize(
    "uri",
    [
        "rockblock://300234010753370",
        "directip://300234010753370",
        "cloudloop://ThInG?imei=300234010753370",
    ],
)
def test_a_satellite_link_is_examined_without_a_message(tmp_path: Path, capsys, uri: str):
    """Each step that lacks something is said; nothing but the gateway's address is called."""
    kind = uri.partition(":")[0]
    ask = ["link", "doctor", uri, "--data", str(tmp_path), "--seconds", "30"]
    assert main(ask) == 1
    assert f"has no account with {kind}" in capsys.readouterr().out
    secrets = SecretStore(Settings(data_dir=tmp_path).secret_dir)
    with socket.socket() as gateway:
        gateway.bind(("127.0.0.1", 0))
        port = gateway.getsockname()[1]
        scheme, path = ("tcp", "") if kind == "directip" else ("http", "/MT")
        account = GatewayAccount(
            url=f"{scheme}://127.0.0.1:{port}{path}",
            username="ann",
            password="secret-word",
            public_key="a key" if kind == "rockblock" else "",
        )
        secrets.set_gateway(kind, account)
        assert main(ask) == 1
        assert "cannot be reached" in capsys.readouterr().out
        gateway.listen()
        status = main(ask)
        said = capsys.readouterr().out
    assert f"127.0.0.1 port {port} can be reached" in said
    assert "secret-word" not in said
    assert status == (1 if kind == "directip" else 0), "no port takes DirectIP messages yet"
    assert ("GRACE_DIRECTIP_PORT" in said) == (kind == "directip")


def test_an_account_that_cannot_be_read_is_named_but_not_where_it_is(tmp_path: Path, capsys):
    (Settings(data_dir=tmp_path).secret_dir / "gateway-rockblock").mkdir(parents=True)
    uri = "rockblock://300234010753370"
    assert main(["link", "doctor", uri, "--data", str(tmp_path), "--seconds", "30"]) == 1
    said = capsys.readouterr().out
    assert "The account cannot be read: secret/gateway-rockblock: Is a directory." in said
    assert str(tmp_path) not in said


async def test_an_acoustic_modem_is_asked_for_its_address(tmp_path: Path):
    line_path = tmp_path / "modem"
    uri, said = f"micromodem://{line_path}?us=1&peer=2", []
    settings = Settings(data_dir=tmp_path)
    assert not await examination.examine_other(uri, settings, 0.2, said.append)
    assert said[0].startswith("No Micro-Modem answers")
    modem = AcousticModem(
        lambda: (0.0, 0.0, 0.0), {}, random.Random(2), AcousticConditions(), SystemClock()
    )
    said.clear()
    async with modem.pty(line_path):
        assert await examination.examine_other(uri, settings, 60.0, said.append)
    assert "answers and has its address" in said[0]


def test_the_command_line_lists_every_link_and_what_is_wrong_with_it(
    tmp_path: Path, capsys, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["link", "list", "--data", str(tmp_path)]) == 0
    assert "There is no robot yet." in capsys.readouterr().out
    links = ("xbee:///dev/x", "rockblock://300234010753370", "serial://dev/y", "tcp://[::1]:5760")
    with closing(Store.open(f"sqlite:///{tmp_path}/station.sqlite3")) as store:
        for name, uris in (("glider-1", links), ("glider-2", ())):
            robot = RobotRecord(
                id=RobotId(name),
                name=name,
                model="grace",
                kind="real",
                system_id=SystemId(7 + len(uris)),
                links=uris,
                site=TANK,
                created_at=SystemClock().now(),
            )
            store.change(partial(add_robot, robot=robot)).result()
    SecretStore(Settings(data_dir=tmp_path).secret_dir).new_signing_key("glider-1")
    assert main(["link", "list", "--data", str(tmp_path)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    for words in (*links, "three", "slashes", "glider-2", "no link", "│ yes"):
        assert words in told
    monkeypatch.setenv("GRACE_TOKEN", "x")
    assert main(["link", "list", "--url", "http://127.0.0.1:1"]) == 1
    assert "does not answer" in capsys.readouterr().err
