"""Films: stretches of the past as files, made in the background, whole or not at all."""

import asyncio
import io
import os
import time
import zipfile
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import msgspec
import numpy as np
import pytest
import zstandard
from PIL import Image

from autonomy.channel import CHANNELS
from autonomy.vehicle.hull import Hull
from db.query.fleet.robots import add_robot
from db.store import Store
from server.access.role import Role
from server.base.worker import WorkCancelledError, WorkerTaskError
from server.replay.film import task
from server.replay.film.films import KEPT, cleared, kept_films
from server.replay.film.order import FilmOrder
from server.replay.film.picture import HEIGHT, WIDTH, ticks
from server.replay.film.scene import SceneFilm
from server.replay.film.task import thinned
from tests.db.conftest import START, robot_record
from tests.db.conftest import report as state_at
from tests.server.conftest import MINI, api_client, until
from tests.server.delivery.written import told
from tests.server.deployment.shore import answered
from tests.server.scene.test_replay import report

FILMS = f"/api/robots/{MINI}/films"
SECOND = timedelta(seconds=1)


@pytest.fixture(scope="module")
def order(tmp_path_factory):
    """A film of a simulated robot that dives three times, as it is asked of a worker."""
    folder = tmp_path_factory.mktemp("film")
    url = f"sqlite:///{folder / 'station.sqlite3'}"
    record = robot_record()
    store = Store.open(url)
    store.change(lambda session: add_robot(session, record)).result()
    late = state_at(400.0, depth_m=0.77, received_at=START + 900 * SECOND)
    store.append([*told(150, ("temperature",)), late]).result()
    store.close()
    return FilmOrder(
        id="00ff", robot=record, first=START, last=START + 300 * SECOND, clock="measured",
        kind="viser", lasts_s=5, made_at=START + timedelta(days=1), database_url=url,
        folder=folder / "film", hull=Hull(), thresholds_m=(0.1, 1.0), channels=CHANNELS,
    )  # fmt: skip


def made(order, kind, name, **more):
    """Make a film in a folder of its own; return what is kept of it, and its content."""
    order = replace(order, kind=kind, folder=order.folder / name, **more)
    kept = task.run(order, lambda _: None, lambda: False)
    return kept, (order.folder / kept.id / kept.name).read_bytes()


def messages(recording):
    content = zstandard.decompress(recording[8:])
    size = int.from_bytes(content[:8], "little")
    return msgspec.msgpack.decode(content[8 : 8 + size], strict=False)


def test_a_recording_lasts_as_long_as_it_was_asked_and_tells_its_moments(order):
    kept, content = made(order, "viser", "recording")
    assert kept.name == "SIMULATION_mini-1_20261121T040000_20261121T040500_viser.viser"
    found = messages(content)
    assert found["durationSeconds"] == pytest.approx(5.0)
    said = str(found["messages"])
    for at in ("04:00:00Z", "04:02:30Z", "04:05:00Z"):
        assert f"2026-11-21 {at}" in said
    places = {str(one) for _, one in found["messages"] if one["type"] == "SetPositionMessage"}
    assert len(places) > 40, "the robot moves from moment to moment"


def test_a_page_plays_without_a_station_and_says_what_it_is(order):
    _, content = made(order, "page", "page")
    page = content.decode()
    assert "window.__VISER_EMBED_DATA__=" in page
    assert "SIMULATION, this robot does not exist." in page
    assert "not live</div>" in page
    assert 'src="http' not in page


def test_pictures_are_numbered_of_one_size_and_go_on(order):
    _, content = made(order, "pictures", "pictures")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
        pictures = [np.asarray(Image.open(io.BytesIO(archive.read(names[n])))) for n in (0, 25, 50)]
        times = archive.read("pictures.csv").decode().splitlines()
    assert names == [*(f"{number:05d}.png" for number in range(1, 52)), "pictures.csv"]
    assert {one.shape for one in pictures} == {(HEIGHT, WIDTH, 3)}
    assert times[2:][0] == "00001.png,2026-11-21T04:00:00+00:00"
    assert times[2:][-1] == "00051.png,2026-11-21T04:05:00+00:00"
    drawn = [np.count_nonzero(np.all(one == (160, 240, 225), axis=2)) for one in pictures]
    assert drawn == sorted(set(drawn)), "the way grows"


def test_what_was_heard_late_is_in_a_film_of_what_happened_alone(order):
    stretch = {"first": START + 350 * SECOND, "last": START + 450 * SECOND}
    said = {
        clock: str(messages(made(order, "viser", clock, clock=clock, **stretch)[1])["messages"])
        for clock in ("measured", "received")
    }
    assert "0.77 m deep" in said["measured"]
    assert "0.77 m deep" not in said["received"]
    before = {"first": START - 100 * SECOND, "last": START - 10 * SECOND}
    _, content = made(order, "viser", "early", **before)
    assert "nothing known yet" in str(messages(content)["messages"])


@pytest.mark.parametrize("kind", ["viser", "pictures"])
def test_a_cancelled_film_leaves_nothing_behind(order, kind):
    order = replace(order, kind=kind, folder=order.folder / f"cancelled {kind}")
    asks = iter([False] * 6)
    with pytest.raises(WorkCancelledError):
        task.run(order, lambda _: None, lambda: next(asks, True))
    assert list(order.folder.iterdir()) == []


def test_a_disk_without_room_is_said_and_nothing_is_kept(order, monkeypatch):
    order = replace(order, folder=order.folder / "full")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(SceneFilm, "finish", full)
    with pytest.raises(ValueError, match=r"the disk did not take the film.*make room"):
        task.run(order, lambda _: None, lambda: False)
    assert list(order.folder.iterdir()) == []


def test_a_long_stretch_has_a_map_at_even_steps_and_each_is_the_newest_then():
    maps = tuple(
        (number, "temperature", model, START + number * SECOND)
        for number, model in enumerate(["one", "other"] * 500)
    )
    first, last = START + 100 * SECOND, START + 900 * SECOND
    kept = thinned(maps, first, last)
    for model in ("one", "other"):
        times = [at for _, _, of, at in kept if of == model]
        assert len(times) == 40
        assert first - SECOND <= times[0] <= first
        assert last - SECOND <= times[-1] <= last
    assert thinned(maps[:3], first, last) == maps[1:3], "before it, the newest of each model"


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.5), (-3.0, 11.0), (995.0, 40_210.0)])
def test_ticks_are_few_round_and_within(low, high):
    found = ticks(low, high)
    assert 2 <= len(found) <= 8
    assert low <= found[0] <= found[-1] <= high


def test_films_that_expired_and_halves_are_cleared_and_others_stay(tmp_path):
    old, new, part = (tmp_path / MINI / name for name in ("old", "new", ".ab.part"))
    for one in (old, new, part):
        one.mkdir(parents=True)
        (one / "film.zip").write_text("x")
    before_s = time.time() - KEPT.total_seconds() - 60.0
    os.utime(old, (before_s, before_s))
    assert cleared(tmp_path, 0.0) == 1
    assert {one.name for one in (tmp_path / MINI).iterdir()} == {"new", ".ab.part"}
    assert cleared(tmp_path, float("inf")) == 1
    assert [one.name for one in (tmp_path / MINI).iterdir()] == ["new"]


def test_what_a_worker_renames_meanwhile_keeps_nothing_else_from_being_cleared(tmp_path):
    for name in (".a.part", ".z.part"):
        (tmp_path / MINI / name).mkdir(parents=True)
    (tmp_path / MINI / "film").mkdir()
    for gone in (".m.part", "film/film.zip"):
        # Listed, and gone when it is asked for: as a folder that is renamed in between.
        (tmp_path / MINI / gone).symlink_to(tmp_path / "gone")
    assert cleared(tmp_path, float("inf")) == 2
    assert list(kept_films(tmp_path / MINI)) == []


async def ended(client, job):
    async def told():
        found = await answered(client.get(f"/api/jobs/{job['id']}"))
        return found["state"] not in ("queued", "running") and found

    return await until(told)


async def test_a_film_is_made_listed_fetched_and_viewers_only_look(client, station, monkeypatch):
    async def run(pool, name, payload, *, on_progress=None, processor_limit_s=None):
        return task.run(payload, on_progress or (lambda _: None), lambda: False)

    monkeypatch.setattr("server.base.worker.WorkerPool.run", run)
    now = datetime.now(UTC)
    for second in range(10):
        at = now - (60 - second) * SECOND
        await report(station, at, at, 0.1 * second)
    stretch = {"first": (now - 60 * SECOND).isoformat(), "last": (now - 50 * SECOND).isoformat()}
    body = {**stretch, "kind": "pictures", "lasts_s": 5}
    done = await ended(client, await answered(client.post(FILMS, json=body), 202))
    assert done["state"] == "done", done["message"]
    shown = await answered(client.get(FILMS))
    (film,) = shown["films"]
    assert (film["id"], film["kind"], shown["job"]) == (done["result"]["film"], "pictures", None)
    assert film["name"].startswith("SIMULATION_mini-1_")
    answer = await client.get(f"{FILMS}/{film['id']}")
    assert len(answer.content) == film["bytes"]
    assert answer.headers["content-disposition"].startswith("attachment")
    await answered(client.get(f"{FILMS}/0011"), 404)
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get(f"{FILMS}/{film['id']}")).is_success
        assert (await viewer.post(FILMS, json=body)).status_code == 403


async def test_a_stretch_that_cannot_be_replayed_is_refused(client, station):
    now = station.foundation.clock.now()
    for first, last, why in (
        (now - 5 * SECOND, now + 60 * SECOND, "has not come yet"),
        (now - 5 * SECOND, now - 5 * SECOND, "at least a second after"),
    ):
        body = {"first": first.isoformat(), "last": last.isoformat()}
        refused = await answered(client.post(FILMS, json=body), 422)
        assert why in refused["errors"][0]["msg"]
    await answered(client.get("/api/robots/nobody/films"), 404)


async def test_one_film_of_a_robot_is_made_at_a_time_and_can_be_cancelled(
    client, station, monkeypatch
):
    begun = asyncio.Event()

    async def wait(*_, **__):
        begun.set()
        await asyncio.sleep(600.0)
        raise WorkerTaskError("nobody cancelled it")

    monkeypatch.setattr("server.base.worker.WorkerPool.run", wait)
    now = station.foundation.clock.now()
    body = {"first": (now - 60 * SECOND).isoformat(), "last": (now - SECOND).isoformat()}
    job = await answered(client.post(FILMS, json=body), 202)
    await begun.wait()
    assert (await answered(client.get(FILMS)))["job"] == job["id"]
    refused = await answered(client.post(FILMS, json=body), 409)
    assert refused["detail"].startswith(f"A film of {MINI} is being made")
    assert (await client.delete(f"/api/jobs/{job['id']}")).is_success
    assert (await ended(client, job))["state"] == "cancelled"
    assert (await answered(client.get(FILMS)))["job"] is None
