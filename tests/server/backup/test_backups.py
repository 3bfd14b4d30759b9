"""A station that backs itself up: by a schedule, at once, called off, failing, and told."""

import asyncio
import os
import stat
import threading
from datetime import timedelta

import pytest

from db.care import complaints
from db.query.station.settings import get_setting, put_setting
from server.access.role import Role
from server.backup import task
from server.backup.backups import FAILED, OLD
from server.backup.failure import BackupError
from server.backup.key import PrivateKey
from server.backup.restoring import restore_backup
from server.backup.shelf import Shelf
from server.base.event_bus import JobChanged
from tests.server.backup.conftest import BackedUp, Wall, backed_up
from tests.server.conftest import until
from tests.server.station_app import signed_in

PATIENCE_S = 200.0
"""For a process that gives way to all others of a busy machine."""


async def ended(here: BackedUp, job: str) -> dict[str, object]:
    async def look():
        told = await here.job(job)
        return told if told["state"] not in ("queued", "running") else None

    return await until(look, PATIENCE_S)


async def until_there_are(here: BackedUp, count: int) -> list[dict[str, object]]:
    async def look():
        found = (await here.view())["backups"]
        return found if len(found) == count and here.backups.job is None else None

    return await until(look)


async def damage(here: BackedUp) -> None:
    """Have every backup from now on refused."""
    await here.foundation.store.write(
        lambda session: session.connection().exec_driver_sql("DROP TABLE raw_frame") and None
    )


def restored(here: BackedUp, name: str, key: PrivateKey | None = None):
    """Restore one of its backups elsewhere; return the URL of the database."""
    other = here.data.parent / f"restored-{name}"
    other.mkdir()
    url = f"sqlite:///{other / 'station.sqlite3'}"
    restore_backup(here.folder / name, other, url, key)
    assert complaints(url) == []
    return other


async def test_a_backup_at_once_is_whole_and_its_owner_s_alone(apart):
    here = apart
    await here.set_up()
    assert (await here.view())["last_good_at"] is None
    told = await ended(here, await here.back_up())
    assert (told["state"], told["progress"]) == ("done", 1.0), told
    [backup] = await until_there_are(here, 1)
    view = await here.view()
    assert backup["name"] == told["result"]["file"]
    assert backup["bytes"] == told["result"]["bytes"] > 1000
    assert backup["at"] == view["last_good_at"] == "2026-03-01T12:00:00Z"
    assert here.files() == [backup["name"]]
    assert stat.S_IMODE((here.folder / backup["name"]).stat().st_mode) == 0o600
    assert (view["is_same_disk"], view["fault"], view["next_at"]) == (True, "", None)
    assert (restored(here, backup["name"]) / "station.sqlite3").is_file()


async def test_an_encrypted_backup_is_opened_by_its_key_alone(here, tmp_path):
    key = PrivateKey.make(tmp_path / "lake.key")
    await here.set_up(public_key=key.public.text)
    assert (await here.view())["key_fingerprint"] == key.public.fingerprint
    told = await ended(here, await here.back_up())
    name = told["result"]["file"]
    assert name.endswith(".sealed")
    content = (here.folder / name).read_bytes()
    assert b"SQLite" not in content
    with pytest.raises(BackupError, match=key.public.fingerprint):
        restored(here, name)
    (here.data.parent / f"restored-{name}").rmdir()
    restored(here, name, key)


async def test_backups_are_made_by_the_schedule_and_old_ones_go(here):
    await here.set_up(is_scheduled=True, hour_utc=2, keep_days=2, keep_weeks=0, keep_months=0)
    [first] = await until_there_are(here, 1)
    assert (await here.view())["next_at"] == "2026-03-02T02:00:00Z"
    here.pass_by(hours=13)
    assert len((await here.view())["backups"]) == 1
    here.pass_by(hours=2)
    _, again = await until_there_are(here, 2)
    assert again == first
    here.pass_by(days=1)

    async def rotated():
        found = (await here.view())["backups"]
        return [one["at"] for one in found] == ["2026-03-03T03:00:00Z", "2026-03-02T03:00:00Z"]

    await until(rotated)


async def test_what_lies_in_the_folder_of_others_stays(here):
    for name in ("grace-000000-20260101T000000Z.tar.gz", "thesis.tar.gz", ".grace-000000-x"):
        (here.folder / name).write_text("precious")
    await here.set_up(keep_days=0, keep_weeks=0, keep_months=0)
    await ended(here, await here.back_up())
    await until_there_are(here, 1)
    assert len(here.files()) == 4


def test_a_folder_that_the_service_sees_read_only_is_refused_with_what_to_do(tmp_path, monkeypatch):
    told = os.statvfs(tmp_path)
    read_only = os.statvfs_result((*told[:8], told.f_flag | os.ST_RDONLY, told.f_namemax))
    monkeypatch.setattr("os.statvfs", lambda _: read_only)
    with pytest.raises(BackupError, match=f"ReadWritePaths={tmp_path}"):
        Shelf(tmp_path, "a1b2c3").check()


async def test_a_backup_that_fails_is_an_alarm_until_one_is_good(here):
    await here.set_up(is_scheduled=True)
    await until_there_are(here, 1)
    away = here.folder.with_name("unplugged")
    here.folder.rename(away)
    here.pass_by(days=1)
    await until(lambda: here.alarms(FAILED))
    assert "There is no folder" in here.alarms(FAILED)[0]
    view = await here.view()
    assert view["failed"] == here.alarms(FAILED)[0]
    assert "cannot be read" in view["fault"]
    here.pass_by(minutes=30)
    away.rename(here.folder)
    here.pass_by(minutes=31)
    await until(lambda: not here.alarms(FAILED))
    await until_there_are(here, 2)


async def test_a_last_good_backup_that_is_older_than_two_periods_is_an_alarm(here):
    await here.set_up(is_scheduled=True)
    [backup] = await until_there_are(here, 1)
    (here.folder / backup["name"]).rename(here.folder / "moved")
    here.folder.chmod(0o700)
    away = here.folder.with_name("unplugged")
    here.folder.rename(away)
    failed = []
    here.foundation.bus.subscribe(
        JobChanged, lambda event: failed.append(event.job.id) if event.job.state == "failed" else 0
    )
    here.pass_by(hours=47)
    await until(lambda: here.alarms(FAILED))
    assert not here.alarms(OLD)
    here.pass_by(hours=2)
    await until(lambda: here.alarms(OLD))
    await until(lambda: len(failed) == 2)  # the next is due an hour after this one
    (away / "moved").rename(away / backup["name"])
    away.rename(here.folder)
    here.pass_by(hours=1)
    await until(lambda: not here.alarms(OLD))


async def test_a_backup_of_a_time_to_come_ends_no_schedule_and_takes_no_backup_s_place(here):
    """A machine whose clock was wrong made it, or has the wrong time now."""
    await here.set_up(is_scheduled=True, keep_days=1, keep_weeks=0, keep_months=0)
    [first] = await until_there_are(here, 1)
    later = first["name"].replace("-20260301T", "-20310301T")
    (here.folder / later).write_text("made by a clock that was wrong")
    view = await here.view()
    assert view["last_good_at"] == "2026-03-01T12:00:00Z"
    assert view["next_at"] == "2026-03-02T02:00:00Z"
    assert later in view["fault"]
    here.pass_by(days=2)

    async def rotated():
        second = first["name"].replace("-20260301T", "-20260303T")
        return here.files() == [second, later]

    await until(rotated)
    (here.folder / later).unlink()
    assert (await here.view())["fault"] == ""


async def test_a_backup_of_a_time_to_come_is_no_last_good_one(here):
    await here.set_up(is_scheduled=True)
    [backup] = await until_there_are(here, 1)
    later = backup["name"].replace("-20260301T", "-20310301T")
    (here.folder / backup["name"]).rename(here.folder / later)
    await damage(here)
    here.pass_by(days=3)
    await until(lambda: here.alarms(OLD))
    assert here.alarms(OLD) == ["There is no good backup of the station."]


async def test_a_damaged_database_is_told_and_takes_no_backup_s_place(here):
    await here.set_up()
    await damage(here)
    told = await ended(here, await here.back_up())
    assert told["state"] == "failed"
    assert "The table raw_frame is missing" in told["message"]
    assert here.files() == []
    await until(lambda: here.alarms(FAILED))


async def test_a_backup_that_is_called_off_leaves_nothing_and_is_no_failure(apart):
    here = apart
    ballast = here.data / "archive" / "ballast"
    ballast.parent.mkdir()
    with ballast.open("wb") as file:
        file.truncate(32 << 30)  # of nothing: it takes no room, and minutes to pack
    await here.set_up()
    job = await here.back_up()

    async def under_way():
        return here.files() and (await here.job(job))["progress"] > 0.0

    await until(under_way, PATIENCE_S)
    answer = await here.client.delete(f"/api/jobs/{job}")
    assert answer.json()["state"] == "cancelled"
    assert here.files() == []
    assert not here.alarms(FAILED)


async def test_while_one_is_made_a_second_is_the_same_one(here, monkeypatch):
    goes_on, make = threading.Event(), task.make_backup

    def make_later(*words):
        assert goes_on.wait(120.0)
        return make(*words)

    monkeypatch.setattr(task, "make_backup", make_later)
    await here.set_up()
    first, second = await asyncio.gather(here.back_up(), here.back_up())
    assert first == second == (await here.view())["job"]
    goes_on.set()
    await ended(here, first)
    assert len(await until_there_are(here, 1)) == 1


async def test_what_a_killed_backup_left_is_no_backup_and_goes(here):
    await here.set_up()
    left = here.folder / f"{here.backups.shelf((await here.backups.standing()).settings).staging}x"
    left.mkdir()
    (left / "backup").write_text("half")
    assert (await here.view())["backups"] == []
    await ended(here, await here.back_up())
    assert here.files() == [(await until_there_are(here, 1))[0]["name"]]


async def test_a_station_that_starts_again_knows_its_backups_and_makes_up_for_missed_ones(
    tmp_path, in_threads
):
    del in_threads
    folder, data, wall = tmp_path / "disk", tmp_path / "data", Wall()
    folder.mkdir()
    async with backed_up(data, folder, wall) as here:
        await here.set_up(is_scheduled=True)
        [first] = await until_there_are(here, 1)
    async with backed_up(data, folder, wall) as here:
        assert (await here.view())["backups"] == [first]
        assert here.backups.job is None
    wall.at = wall.at.replace(day=4)
    async with backed_up(data, folder, wall) as here:
        newest, _ = await until_there_are(here, 2)
        assert newest["at"].startswith("2026-03-04")


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"folder": "/nowhere/at/all"}, "folder"),
        ({"folder": "relative"}, "folder"),
        ({"public_key": "grace-backup-private-00"}, "public_key"),
        ({"hour_utc": 24}, "hour_utc"),
        ({"every_hours": 0}, "every_hours"),
        ({"keep_days": 367}, "keep_days"),
        ({"rhythm": "weekly"}, "rhythm"),
    ],
)
async def test_settings_that_cannot_be_are_refused_by_their_field(here, settings, field):
    answer = await here.change(**settings)
    assert answer.status_code == 422
    assert [error["loc"][-1] for error in answer.json()["errors"]] == [field]


async def test_a_schedule_needs_a_folder_and_so_does_a_backup_at_once(here):
    assert (await here.change(is_scheduled=True)).status_code == 422
    refused = await here.client.post("/api/backups")
    assert (refused.status_code, "folder" in refused.json()["detail"]) == (409, True)


async def test_only_administrators_say_where_secrets_are_written(here):
    async with signed_in(here.client._transport.app, Role.PILOT, "bob") as pilot:
        assert (await pilot.get("/api/backups")).status_code == 200
        assert (await pilot.post("/api/backups")).status_code == 403
        body = {"folder": str(here.folder)}
        assert (await pilot.put("/api/backups/settings", json=body)).status_code == 403


async def test_a_backup_holds_what_was_committed_before_it(here):
    await here.set_up()
    await here.foundation.store.write(lambda session: put_setting(session, "mark", {"n": 1}))
    told = await ended(here, await here.back_up())
    other = restored(here, told["result"]["file"])
    async with backed_up(other, here.folder, here.wall) as again:
        kept = await again.foundation.store.query(lambda session: get_setting(session, "mark"))
        assert kept == {"n": 1}


async def test_a_restored_station_removes_no_backup_of_the_one_that_it_came_from(here):
    await here.set_up(keep_days=0, keep_weeks=0, keep_months=0)
    told = await ended(here, await here.back_up())
    [first] = await until_there_are(here, 1)
    other = restored(here, told["result"]["file"])
    here.wall.at += timedelta(days=1)
    async with backed_up(other, here.folder, here.wall) as twin:
        assert (await twin.view())["backups"] == []
        await ended(twin, await twin.back_up())
        [own] = await until_there_are(twin, 1)
        assert set(twin.files()) == {first["name"], own["name"]}
