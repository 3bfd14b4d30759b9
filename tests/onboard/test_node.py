"""The nodes of a robot: sockets that several programs use at once, and what goes wrong there."""

import asyncio
import json
from contextlib import AsyncExitStack, asynccontextmanager, suppress

import pytest

from onboard.node.client import NodeClient
from onboard.node.server import NodeServer
from onboard.node.wire import (
    LINE_MAX,
    NodeAddress,
    NodeError,
    NodeFault,
    NodeGoneError,
    NodeSilentError,
)
from tests.free_port import free_port
from tests.robot_link.rig import running, until
from tests.tcp_peer import connected, serving


async def double(values):
    return {"value": 2 * values["value"]}


async def never(_values):
    await asyncio.Event().wait()
    return {}


async def broken(_values):
    raise RuntimeError("the device caught fire")


def node() -> NodeServer:
    return NodeServer(
        "test", {"double": double, "never": never, "broken": broken}, ("reading", "state")
    )


@asynccontextmanager
async def client_of(address):
    client = NodeClient(address)
    async with running(client.run):
        await client.connected()
        yield client


async def test_several_programs_ask_one_node_at_once():
    server = node()
    async with server.serve() as address, client_of(address) as first, client_of(address) as second:
        answers = await asyncio.gather(
            *(client.ask("double", value=n) for n in range(4) for client in (first, second))
        )
        assert [answer["value"] for answer in answers] == [0, 0, 2, 2, 4, 4, 6, 6]


async def test_node_says_what_it_can_be_asked():
    async with node().serve() as address, client_of(address) as client:
        said = await client.ask("describe")
        assert said["node"] == "test"
        assert {"double", "describe", "subscribe"} <= set(said["asks"])
        assert said["topics"] == ["reading", "state"]


async def test_only_those_that_subscribed_hear_a_reading():
    server = node()
    async with server.serve() as address, client_of(address) as first, client_of(address) as second:
        heard = first.subscribe("reading", size=10)
        unheard = second.subscribe("state", size=10)
        await first.ask("describe")
        await second.ask("describe")
        for n in range(3):
            server.publish("reading", {"n": n})
        assert [(await heard.get())["n"] for _ in range(3)] == [0, 1, 2]
        server.publish("state", {"n": 9}, is_state=True)
        assert (await unheard.get())["n"] == 9


async def test_program_that_subscribes_late_gets_the_newest_state():
    server = node()
    async with server.serve() as address:
        server.publish("state", {"n": 1}, is_state=True)
        server.publish("reading", {"n": 2})
        async with client_of(address) as client:
            state, reading = client.subscribe("state"), client.subscribe("reading")
            assert (await state.get())["n"] == 1
            server.publish("reading", {"n": 3})
            assert (await reading.get())["n"] == 3


async def test_slow_reader_keeps_the_newest_values_and_knows_what_it_lost():
    server = node()
    async with server.serve() as address, client_of(address) as client:
        newest = client.subscribe("reading", size=2)
        await client.ask("describe")
        for n in range(10):
            server.publish("reading", {"n": n})
        await client.ask("describe")
        await until(lambda: newest.dropped == 8)
        assert [(await newest.get())["n"] for _ in range(2)] == [8, 9]


async def test_program_that_reads_nothing_costs_the_node_a_bounded_memory():
    server = node()
    async with server.serve() as address, connected(address.port) as (reader, writer):
        writer.write(b'{"id": 1, "ask": "subscribe", "with": {"topics": ["reading"]}}\n')
        await reader.readline()
        for n in range(2000):
            server.publish("reading", {"n": n, "ballast": "x" * 20_000})
            if n % 50 == 0:
                await asyncio.sleep(0)
        assert server.dropped > 1000


async def test_program_that_asks_without_reading_is_not_read_on_and_harms_nobody():
    server = node()
    question = b'{"id": 1, "ask": "describe"}\n' * 200
    async with (
        server.serve() as address,
        client_of(address) as other,
        connected(address.port) as (_, writer),
    ):
        async with asyncio.timeout(60.0):
            while writer.transport.get_write_buffer_size() < 1_000_000:
                writer.write(question)
                await asyncio.sleep(0)
        assert (await other.ask("double", value=1))["value"] == 2
        assert max(len(program._said) for program in server._programs) < 100


async def test_node_that_serves_many_programs_hangs_up_on_more():
    async with node().serve() as address, AsyncExitStack() as programs:
        for _ in range(32):
            reader, writer = await programs.enter_async_context(connected(address.port))
            writer.write(b'{"id": 1, "ask": "describe"}\n')
            assert await reader.readline()
        reader, _ = await programs.enter_async_context(connected(address.port))
        with suppress(ConnectionError):
            assert await reader.read() == b""


@pytest.mark.parametrize("text", [b"NaN", b"Infinity", b"9" * 5000, b"[" * 30_000])
async def test_value_that_is_no_json_is_refused(text):
    async with node().serve() as address, connected(address.port) as (reader, writer):
        writer.write(b'{"id": 1, "ask": "double", "with": {"value": ' + text + b"}}\n")
        said = json.loads(await reader.readline())
        assert "not JSON" in said["error"]


@pytest.mark.parametrize(
    "line",
    [
        b'{"topic": "reading"}',
        b'{"topic": "reading", "value": 3}',
        b'{"id": 1, "error": "no", "kind": "odd"}',
        b'{"id": [1], "answer": {}}',
        b"{}",
        b"\xff",
    ],
)
async def test_node_that_talks_nonsense_does_not_stop_the_program(line):
    async def meet(_reader, writer):
        writer.write(line + b"\n" + b'{"topic": "reading", "value": {"n": 1}}\n')
        await writer.drain()

    async with serving(meet) as port:
        client = NodeClient(NodeAddress(port=port))
        heard = client.subscribe("reading")
        async with running(client.run):
            assert await heard.get() == {"n": 1}


@pytest.mark.parametrize(
    ("ask", "values", "fault", "sentence"),
    [
        ("x" * 65_000, {}, NodeFault.UNKNOWN, "does not know 'xxx"),
        ("subscribe", {"topics": [["nonsense"]]}, NodeFault.BAD, "reading, state"),
        ("dive", {}, NodeFault.UNKNOWN, "does not know 'dive'; it knows double"),
        ("double", {}, NodeFault.BAD, "value"),
        ("broken", {}, NodeFault.FAILED, "its log says why"),
        ("subscribe", {"topics": ["nonsense"]}, NodeFault.BAD, "reading, state"),
    ],
)
async def test_error_says_what_the_program_can_do(ask, values, fault, sentence, caplog):
    async with node().serve() as address, client_of(address) as client:
        with pytest.raises(NodeError, match=sentence) as error:
            await client.ask(ask, **values)
        assert error.value.fault is fault
        assert (await client.ask("double", value=4))["value"] == 8


async def test_answer_that_does_not_come_is_not_waited_for():
    async with node().serve() as address, client_of(address) as client:
        with pytest.raises(NodeSilentError, match="did not answer never"):
            await client.ask("never", timeout_s=0.05)


async def test_too_many_questions_at_once_are_refused_and_others_are_not():
    async with node().serve() as address, client_of(address) as greedy, client_of(address) as other:
        waiting = [asyncio.create_task(greedy.ask("never", timeout_s=60.0)) for _ in range(8)]
        await asyncio.sleep(0)
        with pytest.raises(NodeError) as error:
            await greedy.ask("double", value=1)
        assert error.value.fault is NodeFault.BUSY
        assert (await other.ask("double", value=1))["value"] == 2
        for task in waiting:
            task.cancel()
        await asyncio.gather(*waiting, return_exceptions=True)


async def test_garbage_is_answered_with_a_sentence_and_then_cut_off():
    async with node().serve() as address, connected(address.port) as (reader, writer):
        writer.write(b"\xff\xfe not json\n[1]\n" + b'{"id": "x", "ask": 3}\n' * 10)
        lines = (await reader.read()).splitlines()
        assert 2 < len(lines) < 12
        assert all("not a question" in json.loads(line)["error"] for line in lines)


async def test_line_without_end_is_cut_off_and_others_are_served_on():
    async with node().serve() as address, client_of(address) as client:
        async with connected(address.port) as (_, writer):
            with suppress(ConnectionError):
                writer.write(b"x" * (2 * LINE_MAX))
                await writer.wait_closed()
            assert writer.transport.is_closing()
        assert (await client.ask("double", value=1))["value"] == 2


async def test_program_finds_a_node_that_was_started_again_and_hears_it_as_before():
    address = NodeAddress(port=free_port())
    client = NodeClient(address)
    heard = client.subscribe("reading", size=5)
    with pytest.raises(NodeGoneError, match="no connection"):
        await client.ask("describe")
    async with running(client.run):
        for n in range(2):
            server = node()
            async with server.serve(address):
                await client.connected()
                await client.ask("describe")
                server.publish("reading", {"n": n})
                assert (await heard.get())["n"] == n
                waiting = asyncio.create_task(client.ask("never", timeout_s=60.0))
                await asyncio.sleep(0)
            with pytest.raises(NodeGoneError, match="closed the connection"):
                await waiting


@pytest.mark.parametrize(
    "text", ["tcp://0.0.0.0:80", "tcp://example.org:1", "udp://x", "tcp://127.0.0.1"]
)
def test_address_that_other_machines_reach_is_refused(text):
    with pytest.raises(ValueError, match="node"):
        NodeAddress.of(text)


def test_address_reads_what_it_writes():
    assert str(NodeAddress.of("tcp://127.0.0.1:4567")) == "tcp://127.0.0.1:4567"
