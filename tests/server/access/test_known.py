"""Whom the station let in a moment ago, it lets in again without asking the database."""

from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from db.query.station.people import list_tokens, revoke_token
from db.store import Store
from server.access import access as module
from server.access.role import Role
from tests.server.conftest import until
from tests.server.station_app import bearer, token_of

FOR_EVER_S = 1e9


@pytest.fixture
def looks(monkeypatch):
    """Counts looks into the database, of which each is believed for ever."""
    counted, look = [], module.callers_of

    def counting(session, proofs, at):
        counted.append(proofs)
        return look(session, proofs, at)

    monkeypatch.setattr(module, "callers_of", counting)
    monkeypatch.setattr(module, "LOOK_S", FOR_EVER_S)
    return counted


async def ask(client, token):
    return (await client.get("/api/groups", headers=bearer(token))).status_code


async def test_a_token_is_looked_up_once_while_nothing_changes(app, admin, looks):
    token = await token_of(app, Role.VIEWER, "plot")
    store = app.state.foundation.store
    assert await ask(admin, token) == 200
    changes, looked = store.changes, len(looks)
    statuses = [await ask(admin, token) for _ in range(5)]
    assert statuses == [200] * 5
    assert len(looks) - looked <= store.changes - changes + 1


async def test_what_the_station_revokes_ends_with_the_very_next_request(app, admin, looks):
    token = await token_of(app, Role.VIEWER, "plot")
    assert await ask(admin, token) == 200
    for one in (await admin.get("/api/tokens")).json()["tokens"]:
        if one["name"] == "plot":
            assert (await admin.delete(f"/api/tokens/{one['id']}")).is_success
    assert await ask(admin, token) == 401
    assert looks


async def test_what_has_expired_ends_though_it_was_let_in_a_moment_ago(
    app, admin, looks, monkeypatch
):
    token = await token_of(app, Role.VIEWER, "plot")
    assert await ask(admin, token) == 200
    later = SimpleNamespace(now=lambda: datetime(9000, 1, 1, tzinfo=UTC))
    monkeypatch.setattr(app.state.foundation.services.get(module.Access), "_wall", later)
    assert await ask(admin, token) == 401
    assert looks


async def test_what_another_process_revokes_ends_soon(app, admin):
    token = await token_of(app, Role.VIEWER, "plot")
    assert await ask(admin, token) == 200
    settings = app.state.foundation.settings
    other = Store.open(settings.resolved_database_url)

    def revoke(session):
        for one in list_tokens(session):
            if one.name == "plot":
                revoke_token(session, one.id, datetime.now(UTC))

    try:
        other.change(revoke).result(60)
    finally:
        other.close()

    async def is_refused():
        return await ask(admin, token) == 401

    await until(is_refused)
