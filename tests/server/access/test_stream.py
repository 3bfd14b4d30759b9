"""A stream ends with the sign-in that opened it."""

import asyncio
import contextlib
import threading
from datetime import UTC, datetime, timedelta
from functools import partial

import httpx
import pytest
import viser
import websockets
from sqlalchemy import update

from db.person_tables import Session as SessionRow
from server.access import stream
from server.access.access import LOOK_S, Access
from server.access.role import Role
from server.access.stream import SignInWatch
from server.target import route as target_route
from tests.server.conftest import GRACE, MINI, until
from tests.server.station_app import PASSWORD, bearer, client_of, token_of

SOON_S = 1.0
connect = partial(websockets.connect, open_timeout=60)


@pytest.fixture
async def bob(client):
    """A person who signed in by a browser."""
    for name, role in (("ann", "admin"), ("bob", "pilot")):
        person = {"name": name, "role": role, "password": PASSWORD}
        assert (await client.post("/api/people", json=person)).status_code == 201
    async with client_of(client.app) as browser:
        signed_in = await browser.post("/api/session", json={"name": "bob", "password": PASSWORD})
        browser.headers["X-CSRF-Token"] = signed_in.json()["csrf_token"]
        yield browser


async def ticket(client, **options):
    answer = await client.post("/api/session/ticket", **options)
    return answer.json()["ticket"]


async def revoke(client, bob):
    del bob
    for token in (await client.get("/api/tokens")).json()["tokens"]:
        if token["name"] == "plot":
            await client.delete(f"/api/tokens/{token['id']}")


async def sign_out(client, bob):
    del client
    assert (await bob.delete("/api/session")).status_code == 204


async def disable(client, bob):
    del bob
    assert (await client.patch("/api/people/bob", json={"disabled": True})).is_success


async def change_role(client, bob):
    del bob
    assert (await client.patch("/api/people/bob", json={"role": "viewer"})).is_success


async def expire(client, bob):
    del bob
    past = datetime.now(UTC) - timedelta(seconds=1)
    await client.app.state.foundation.store.write(
        lambda session: session.execute(update(SessionRow).values(expires_at=past))
    )


@pytest.mark.parametrize("path", ["/api/live", f"/view/{GRACE}"])
@pytest.mark.parametrize("end", [revoke, sign_out, disable, change_role, expire])
async def test_a_stream_ends_within_a_second_of_its_sign_in(client, address, bob, end, path):
    if end is revoke:
        headers = {"Authorization": f"Bearer {await token_of(client.app, Role.PILOT, 'plot')}"}
        opened_by = await ticket(client, headers=headers)
    else:
        opened_by = await ticket(bob)
    async with connect(
        f"ws://{address}{path}?ticket={opened_by}",
        subprotocols=[f"viser-v{viser.__version__}"] if path != "/api/live" else None,
        compression=None,
    ) as stream:
        await stream.recv()
        await end(client, bob)
        with contextlib.suppress(websockets.ConnectionClosed):
            async with asyncio.timeout(60):
                while True:
                    await stream.recv()
        assert stream.close_code == 1008


def test_streams_are_looked_at_often_enough():
    assert LOOK_S < SOON_S / 2


async def test_text_from_a_client_of_the_live_stream_is_ignored(client, address):
    uri = f"ws://{address}/api/live?ticket={await ticket(client)}"
    async with connect(uri) as stream:
        await stream.send("what is this")
        for _ in range(3):
            await stream.recv()


async def test_nobody_opens_streams_without_end(client, address, monkeypatch):
    monkeypatch.setattr(stream, "STREAMS_MAX", 1)
    uri = f"ws://{address}/api/live?ticket="
    async with connect(uri + await ticket(client)) as first:
        await first.recv()
        async with connect(uri + await ticket(client)) as second:
            with pytest.raises(websockets.ConnectionClosedError):
                await second.recv()
            assert second.close_code == 1013
    watch = client.app.state.foundation.services.get(SignInWatch)
    await until(lambda: not +watch.streams)
    async with connect(uri + await ticket(client)) as again:
        await again.recv()


async def test_script_that_is_called_as_a_person_takes_none_of_their_streams(
    client, address, bob, monkeypatch
):
    monkeypatch.setattr(stream, "STREAMS_MAX", 1)
    uri = f"ws://{address}/api/live?ticket="
    script = {"headers": bearer(await token_of(client.app, Role.PILOT, "bob"))}
    async with connect(uri + await ticket(client, **script)) as first:
        await first.recv()
        async with connect(uri + await ticket(bob)) as second:
            await second.recv()


async def test_many_streams_of_one_sign_in_are_one_question(client, address, monkeypatch):
    access = client.app.state.foundation.services.get(Access)
    asked, ask = [], access.rights_of

    async def note(proofs):
        asked.append(len(proofs))
        return await ask(proofs)

    monkeypatch.setattr(access, "rights_of", note)
    uri = f"ws://{address}/api/live?ticket="
    async with contextlib.AsyncExitStack() as streams:
        for _ in range(5):
            stream = connect(uri + await ticket(client))
            await (await streams.enter_async_context(stream)).recv()
        asked.clear()
        await until(lambda: len(asked) > 2)
        assert set(asked) == {1}


async def rest_of(pieces):
    async for _ in pieces:
        pass


async def test_a_download_ends_within_a_second_of_its_sign_in(client, address, bob, monkeypatch):
    is_over = threading.Event()

    def endless(*_):
        while not is_over.wait(0.01):
            yield "row\n"

    monkeypatch.setattr(target_route, "target_csv_blocks", endless)
    path = f"http://{address}/api/robots/{MINI}/tracking.csv"
    headers = {"Authorization": f"Bearer {await token_of(client.app, Role.PILOT, 'plot')}"}
    try:
        async with (
            httpx.AsyncClient(timeout=60) as browser,
            browser.stream("GET", path, headers=headers) as answer,
        ):
            pieces = answer.aiter_bytes()
            await anext(pieces)
            await revoke(client, bob)
            with pytest.raises(httpx.RemoteProtocolError):
                await asyncio.wait_for(rest_of(pieces), 60)
    finally:
        is_over.set()
