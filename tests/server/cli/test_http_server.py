"""Connections that ask for nothing are not kept."""

import asyncio
import contextlib
import socket

import httpx
import pytest
import uvicorn
from websockets.asyncio.client import connect

from server.cli import http_server
from server.cli.http_server import HttpServer, ImpatientHttp
from tests.server.conftest import until


async def answer(scope, receive, send):
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        while (said := await receive())["type"] != "websocket.disconnect":
            if "text" in said:
                await send({"type": "websocket.send", "text": said["text"]})
        return
    await send(
        {"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]}
    )
    await send({"type": "http.response.body", "body": b"ok"})


@pytest.fixture
async def server(monkeypatch):
    monkeypatch.setattr(http_server, "HEADER_MAX_S", 600.0)
    config = uvicorn.Config(
        answer, host="127.0.0.1", port=0, lifespan="off", log_level="error", http=ImpatientHttp
    )
    server = HttpServer(config)
    serving = asyncio.create_task(server.serve())
    await until(lambda: server.started)
    yield server
    server.should_exit = True
    await serving


@pytest.fixture
def port(server):
    return server.servers[0].sockets[0].getsockname()[1]


async def test_an_answer_in_two_pieces_does_not_wait_for_an_acknowledgement():
    server = HttpServer(
        uvicorn.Config(answer, lifespan="off", log_level="error", http=ImpatientHttp)
    )
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        serving = asyncio.create_task(server.serve(sockets=[listener]))
        await until(lambda: server.started)
        _, writer = await asyncio.open_connection(*listener.getsockname())
        await until(lambda: server.server_state.connections)
        (taken,) = server.server_state.connections
        connection = taken.transport.get_extra_info("socket")
        assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
        writer.close()
        server.stop()
        await serving


@pytest.fixture
def impatient(port, monkeypatch):
    monkeypatch.setattr(http_server, "HEADER_MAX_S", 0.2)


@pytest.mark.parametrize(
    "said",
    [b"", b"GET / HTTP/1.1\r\nHost: a\r\nX-", b"GET / HTTP/1.1\r\nHost: a\r\n\r\nGET / HTTP"],
    ids=["nothing", "half a head", "half a head after a request"],
)
@pytest.mark.usefixtures("impatient")
async def test_a_connection_that_asks_for_nothing_is_ended(port, said):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(said)
    try:
        async with asyncio.timeout(60):
            heard = await reader.read()
    except ConnectionResetError:
        heard = b""
    finally:
        writer.close()
    assert heard.count(b"ok") <= 1


@pytest.mark.usefixtures("impatient")
async def test_a_head_that_drips_is_ended_all_the_same(port):
    reader, writer = await asyncio.open_connection("127.0.0.1", port)

    async def drip():
        writer.write(b"GET / HTTP/1.1\r\n")
        while True:
            writer.write(b"X-A: b\r\n")
            await asyncio.sleep(0.02)

    dripping = asyncio.create_task(drip())
    try:
        async with asyncio.timeout(60):
            await reader.read()
    except ConnectionResetError:
        pass
    finally:
        dripping.cancel()
        writer.close()


async def test_connections_beyond_the_bound_are_not_taken(port, monkeypatch):
    monkeypatch.setattr(http_server, "CONNECTIONS_MAX", 2)
    kept = [await asyncio.open_connection("127.0.0.1", port) for _ in range(2)]
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    with pytest.raises((ConnectionResetError, asyncio.IncompleteReadError)):
        await asyncio.wait_for(reader.readexactly(1), 60)
    for _, one in [*kept, (reader, writer)]:
        one.close()


async def test_a_request_is_answered_as_before(port):
    async with httpx.AsyncClient(trust_env=False, timeout=60) as client:
        for _ in range(3):
            assert (await client.get(f"http://127.0.0.1:{port}/")).text == "ok"


async def test_a_stream_outlives_the_time_for_a_head(port, monkeypatch):
    taken = []
    begin = ImpatientHttp.handle_websocket_upgrade

    def upgrade(connection, event):
        begin(connection, event)
        taken.append(connection._head)

    monkeypatch.setattr(ImpatientHttp, "handle_websocket_upgrade", upgrade)
    async with connect(f"ws://127.0.0.1:{port}/", proxy=None, open_timeout=60) as stream:
        assert taken == [None]
        monkeypatch.setattr(http_server, "HEADER_MAX_S", 0.2)
        for number in range(30):
            await stream.send(str(number))
            assert await asyncio.wait_for(stream.recv(), 60) == str(number)
            await asyncio.sleep(http_server.HEADER_MAX_S / 10)


async def test_who_has_just_connected_is_answered_by_a_server_that_stops(port, server, monkeypatch):
    monkeypatch.setattr(http_server, "LAST_REQUEST_S", 60.0)
    asked = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    idle, between = await asyncio.open_connection("127.0.0.1", port)
    between.write(asked)
    assert b"200 OK" in await idle.readuntil(b"ok")
    await until(lambda: len(server.server_state.connections) == 2)
    server.stop()
    assert await idle.read() == b""  # it may ask another server
    writer.write(asked)
    heard = await reader.read()
    assert b"200 OK" in heard
    writer.close()
    between.close()
    await until(lambda: not server.server_state.connections)


async def test_who_never_asks_holds_up_no_server_that_stops(port, server, monkeypatch):
    monkeypatch.setattr(http_server, "LAST_REQUEST_S", 0.1)
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    await until(lambda: server.server_state.connections)
    server.stop()
    with contextlib.suppress(ConnectionResetError):
        assert await reader.read() == b""
    writer.close()
