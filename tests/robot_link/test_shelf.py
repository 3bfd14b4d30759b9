"""Lines of radios that are left open for whoever serves them next."""

import asyncio
import os
import pty
import socket
import tty
from contextlib import asynccontextmanager
from functools import cache, partial

import pytest

from robot_link.mavlink.codec import Codec
from robot_link.mavlink.wire import grace
from robot_link.transport import mavlink_stream
from robot_link.transport.datagram import Received
from robot_link.transport.mavlink_stream import StreamTiming
from robot_link.transport.opening import open_transport
from robot_link.transport.shelf import Shelf
from tests.free_port import free_port

LIMIT_S = 60.0
CODEC = Codec(21, 1)


@cache  # each packing has a number of its own
def frame(number):
    return CODEC.pack(grace.MAVLink_ping_message(number, number, 0, 0))


def numbers(heard):
    return [message.seq for data in heard for message in CODEC.unpack(data).messages]


@asynccontextmanager
async def serving(transport, heard):
    """Run a transport and collect what it hears."""

    async def listen():
        async for event in transport.events():
            if isinstance(event, Received):
                heard.append(event.data)

    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(transport.run()), group.create_task(listen())]
        yield transport
        for task in tasks:
            task.cancel()


async def until(condition):
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - it watches another task
            await asyncio.sleep(0.01)


@pytest.fixture
def line(tmp_path):
    robot, station = pty.openpty()
    tty.setraw(robot)
    tty.setraw(station)
    path = tmp_path / "line"
    path.symlink_to(os.ttyname(station))
    yield robot, f"serial://{path}"
    os.close(robot)
    os.close(station)


async def test_a_line_brings_every_frame_once_to_whoever_serves_it_next(line, monkeypatch):
    # half a frame is waited for, however long the machine stands still
    monkeypatch.setattr(mavlink_stream, "StreamTiming", partial(StreamTiming, quiet_s=60.0))
    robot, uri = line
    shelf, first, second = Shelf(), [], []
    async with serving(open_transport(uri, shelf), first) as transport:
        await until(lambda: transport.max_payload)
        os.write(robot, frame(0))
        await until(lambda: first)
        shelf.is_open = True
        os.write(robot, frame(1)[:7])  # the beginning of a frame is the next one's
        await asyncio.sleep(0)
        await transport.let_go()
    assert numbers(first) == [0]
    assert shelf.uris == (uri,)
    large = b"".join(frame(number) for number in range(2, 400))  # more than a terminal's buffer
    os.set_blocking(robot, False)
    rest = frame(1)[7:] + large
    while rest:
        try:
            rest = rest[os.write(robot, rest) :]
        except BlockingIOError:
            await asyncio.sleep(0.01)
    shelf.is_open = False
    async with serving(open_transport(uri, shelf), second) as transport:
        await until(lambda: len(numbers(second)) >= 399)
        assert numbers(second) == list(range(1, 400))
        assert shelf.uris == ()
        await transport.send(None, frame(7))
        os.set_blocking(robot, True)
        assert os.read(robot, 65536) == frame(7)


async def test_a_socket_keeps_its_port_and_what_was_said_to_it(line):
    port = free_port(socket.SOCK_DGRAM)
    uri = f"udp://127.0.0.1:{port}?listen=1"
    shelf, first, second = Shelf(), [], []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.connect(("127.0.0.1", port))
        async with serving(open_transport(uri, shelf), first) as transport:
            await until(lambda: transport.max_payload)
            robot.send(frame(0))
            await until(lambda: first)
            shelf.is_open = True
            await transport.let_go()
        for number in range(1, 40):
            robot.send(frame(number))
        shelf.is_open = False
        async with serving(open_transport(uri, shelf), second) as transport:
            await until(lambda: len(second) >= 39)
            robot.send(frame(40))
            await until(lambda: len(second) >= 40)
            assert numbers(second) == list(range(1, 41))
            await transport.send(None, frame(7))  # to whom was heard while nobody served
            robot.settimeout(LIMIT_S)
            assert await asyncio.to_thread(robot.recv, 2048) == frame(7)


async def test_without_a_shelf_that_is_open_a_line_is_closed(line):
    _, uri = line
    shelf = Shelf()
    async with serving(open_transport(uri, shelf), []) as transport:
        await until(lambda: transport.max_payload)
    assert shelf.uris == ()


async def test_what_nobody_takes_is_closed(line):
    _, uri = line
    shelf = Shelf()
    async with serving(open_transport(uri, shelf), []) as transport:
        await until(lambda: transport.max_payload)
        shelf.is_open = True
        await transport.let_go()
    line_open = shelf.take(uri)
    assert line_open is not None
    shelf.put(uri, line_open)
    shelf.close()
    with pytest.raises(OSError, match="Bad file"):
        os.fstat(line_open.descriptor)
