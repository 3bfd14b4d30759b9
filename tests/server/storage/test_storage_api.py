import sqlite3
from contextlib import closing
from dataclasses import replace
from datetime import timedelta

import pytest
import pytest_asyncio
from sqlalchemy import update

from db.fault import StoreUnavailableError
from db.query.station.settings import put_setting
from db.space import vacuum
from db.storage_tables import ArchiveFileRow
from db.tables import Deployment
from server.access.role import Role
from server.app import create_app
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.settings import Settings
from server.station import Station
from server.storage.archive import FOLDER, MANIFEST
from server.storage.passes import Passes, next_hour
from server.storage.sizes import SETTING, Sizes
from tests.db.conftest import ON_POSTGRESQL, report
from tests.server.conftest import MINI, until
from tests.server.station_app import running, signed_in
from tests.server.storage.conftest import NOW

RULES = {"states": {"then": "thin", "after_days": 30, "period_s": 60}}


@pytest_asyncio.fixture
async def app(tmp_path, monkeypatch):
    # a look that the station takes by itself might end after one that a test asked for later
    monkeypatch.setattr("server.storage.sizes._FIRST_AFTER_S", 1e6)
    made = create_app(Settings(data_dir=tmp_path, simulation=True), Station)
    async with made.router.lifespan_context(made):
        yield made


@pytest_asyncio.fixture
async def admin(app):
    async with signed_in(app) as client:
        yield client


async def job_of(client, answer):
    assert answer.status_code == 202, answer.text
    path = f"/api/jobs/{answer.json()['id']}"

    async def ended():
        job = (await client.get(path)).json()
        return job if job["state"] not in ("queued", "running") else None

    return await until(ended)


async def old_states(app):
    """Have a robot report for an hour, two months ago, in a deployment that has ended."""
    foundation: Foundation = app.state.foundation
    begin = (foundation.clock.now() - timedelta(days=60)).replace(hour=10, minute=0)

    def change(session):
        session.execute(
            update(Deployment).values(
                state="recovered",
                started_at=begin - timedelta(days=1),
                ended_at=begin + timedelta(days=1),
            )
        )

    await foundation.store.write(change)
    values = [
        replace(
            report(0.0, 5.0 + step % 5, MINI),
            measured_at=begin + timedelta(seconds=step),
            received_at=begin + timedelta(seconds=step),
        )
        for step in range(0, 3600, 5)
    ]
    foundation.store.append(values).result(60)
    return begin, len(values)


async def test_sizes_tell_rows_and_ages(app, admin):
    begin, rows = await old_states(app)
    await app.state.foundation.services.get(Sizes).renew()
    look = (await admin.get("/api/storage")).json()["look"]
    states = next(one for one in look["kinds"] if one["key"] == "states")
    assert states["rows"] == rows
    assert states["oldest_at"].startswith(f"{begin:%Y-%m-%dT%H}")
    assert 50 * rows < states["bytes"] < 400 * rows
    assert look["disk_free_bytes"] > 0
    assert look["elsewhere_bytes"] == 0


async def test_rows_are_counted_on_without_being_counted_again(app):
    sizes = app.state.foundation.services.get(Sizes)
    _, rows = await old_states(app)
    await sizes.renew()
    more = [report(float(step), 1.0, MINI) for step in range(7)]
    app.state.foundation.store.append(more).result(60)
    look = await sizes.renew()
    assert {one.key: one.rows for one in look.kinds}["states"] == rows + 7


async def test_what_would_go_is_what_goes(app, admin):
    begin, rows = await old_states(app)
    looked = await job_of(admin, await admin.post("/api/storage/preview", json=RULES))
    assert looked["state"] == "done", looked
    going = looked["result"]
    assert [(one["kind"], one["robot"]) for one in going["going"]] == [("states", MINI)]
    assert 0 < going["rows"] < rows
    assert (await admin.get("/api/config/storage")).json()["value"]["states"]["then"] == "keep"
    stored = await admin.patch("/api/config/storage", json=RULES)
    assert stored.status_code == 200, stored.text
    done = await job_of(admin, await admin.post("/api/storage/passes"))
    assert done["state"] == "done", done
    assert done["result"]["thinned"] == {"states": going["rows"]}
    told = (await admin.get("/api/storage")).json()
    assert told["last_pass"]["is_whole"]
    assert told["next_pass_at"] is not None
    events = (await admin.get("/api/events", params={"kinds": "storage.pruned"})).json()
    assert events["events"][-1]["text"] == told["last_pass"]["message"]
    sentence = f"State reports from {begin:%Y-%m-%d} to {begin:%Y-%m-%d} are thinned"
    chart = await admin.get(f"/api/robots/{MINI}/samples", params={"channel": "depth_m"})
    track = await admin.get(f"/api/robots/{MINI}/track")
    timeline = await admin.get(f"/api/robots/{MINI}/timeline", params={"at": begin.isoformat()})
    for answer in (chart, track, timeline):
        assert answer.json()["pruned"][0].startswith(sentence), answer.text
    later = {"channel": "depth_m", "start": (begin + timedelta(days=2)).isoformat()}
    assert (await admin.get(f"/api/robots/{MINI}/samples", params=later)).json()["pruned"] == []


async def test_rules_are_set_by_administrators_for_the_station(app, admin):
    wrong = {"states": {"period_s": 0}}
    refused = await admin.patch("/api/config/storage", json=wrong)
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["loc"] == ["states", "period_s"]
    of_robot = await admin.patch("/api/config/storage", params={"robot": MINI}, json=RULES)
    assert of_robot.status_code == 422
    async with signed_in(app, Role.PILOT, "bob") as pilot:
        assert (await pilot.patch("/api/config/storage", json=RULES)).status_code == 403
        assert (await pilot.post("/api/storage/passes")).status_code == 403
        assert (await pilot.get("/api/storage")).status_code == 200


async def test_a_disk_that_fills_soon_is_an_alarm(app, admin, monkeypatch):
    sizes = app.state.foundation.services.get(Sizes)
    monkeypatch.setattr(sizes, "full_in_days", lambda: 3.0)
    await sizes.renew()
    alarms = (await admin.get("/api/alarms")).json()["alarms"]
    assert any("full in about 3 days" in one["text"] for one in alarms)
    monkeypatch.setattr(sizes, "full_in_days", lambda: 30.0)
    await sizes.renew()
    standing = (await admin.get("/api/alarms")).json()["alarms"]
    assert not any("full in" in one["text"] and one["cleared_at"] is None for one in standing)


async def test_rules_that_are_saved_after_storage_failed_are_taken_up(app, admin, monkeypatch):
    foundation: Foundation = app.state.foundation
    passes, current = foundation.services.get(Passes), foundation.configurations.current
    faults = [StoreUnavailableError("The disk is full.")]

    async def failing(kind, robot):
        if kind == "storage" and faults:
            raise faults.pop()
        return await current(kind, robot)

    with monkeypatch.context() as patch:
        patch.setattr(foundation.configurations, "current", failing)
        passes.settings_changed(SettingsChanged("storage", None))
        await until(lambda: not faults)
    for hour in (3, 4):
        stored = await admin.patch("/api/config/storage", json={**RULES, "hour": hour})
        assert stored.status_code == 200, stored.text
        await until(lambda hour=hour: passes.next_at is not None and passes.next_at.hour == hour)


async def test_a_manifest_that_cannot_be_written_is_an_alarm(app, admin):
    foundation: Foundation = app.state.foundation
    passes = foundation.services.get(Passes)
    file = ArchiveFileRow(
        kind="states",
        robot_key=1,
        day=20_000,
        path="states/mini-1/2024-10-04.jsonl.gz",
        rows=1,
        bytes=1,
        sha256="00",
        first_at=NOW,
        last_at=NOW,
        state="moved",
        written_at=NOW,
    )
    await foundation.store.write(lambda session: session.add(file))
    (foundation.settings.data_dir / FOLDER / MANIFEST).mkdir(parents=True)
    (foundation.settings.data_dir / FOLDER / MANIFEST / "of somebody").touch()
    failed = await job_of(admin, await admin.post("/api/storage/passes"))
    assert failed["state"] == "failed"
    assert f"{MANIFEST} cannot be written" in failed["message"]
    passes.next_at = foundation.clock.now()
    passes.settings_changed(SettingsChanged("storage", None))

    async def is_told():
        alarms = (await admin.get("/api/alarms")).json()["alarms"]
        return any(f"{MANIFEST} cannot be written" in one["text"] for one in alarms)

    await until(is_told)


@ON_POSTGRESQL
async def test_a_disk_is_filled_by_what_lies_on_it_alone(tmp_path, store, url):
    del store
    async with running(tmp_path, database_url=url) as made:
        foundation: Foundation = made.state.foundation
        sizes = Sizes(foundation)
        look = await sizes.renew()
        assert look.used_bytes > look.elsewhere_bytes > 0
        a_day_ago = {
            "at": (look.at - timedelta(days=1)).isoformat(),
            "used_bytes": look.used_bytes - 50 * 10**9,
            "on_disk_bytes": look.on_disk_bytes - 10**9,
            "rows": {},
        }
        kept = {"counts": {}, "gone": {}, "marks": [a_day_ago]}
        await foundation.store.write(lambda session: put_setting(session, SETTING, kept))
        await sizes.load()
        look = await sizes.renew()
        assert sizes.growth_bytes_per_day() == pytest.approx(50e9, rel=0.05)
        assert sizes.full_in_days() == pytest.approx(look.disk_free_bytes / 1e9, rel=0.05)


def test_the_next_pass_is_at_its_hour():
    assert next_hour(NOW.replace(hour=1), 2) == NOW.replace(hour=2)
    assert next_hour(NOW.replace(hour=2), 2) == NOW.replace(hour=2) + timedelta(days=1)


def test_vacuum_gives_the_room_back(tmp_path):
    file = tmp_path / "of_rows.sqlite3"
    with closing(sqlite3.connect(file)) as base:
        base.execute("create table row (data blob)")
        base.executemany("insert into row values (?)", [(bytes(4000),)] * 500)
        base.execute("delete from row")
        base.commit()
    done = vacuum(f"sqlite:///{file}")
    assert done.after_bytes < done.before_bytes / 10
    assert file.stat().st_size == done.after_bytes
