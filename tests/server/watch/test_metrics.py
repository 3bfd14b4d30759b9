"""What Prometheus reads of a station."""

import asyncio
import time
from collections.abc import Callable
from functools import partialmethod
from pathlib import Path

import httpx
import pytest
from prometheus_client import ProcessCollector
from prometheus_client.parser import text_string_to_metric_families
from pydantic import ValidationError
from sqlalchemy.orm import Session

from db.fault import StoreUnavailableError
from server.access.access import Access
from server.access.role import Role
from server.base.foundation import Foundation
from server.base.settings import Settings
from tests.server.conftest import GRACE, MINI, StationClient, until
from tests.server.fake_link import World, state_report
from tests.server.station_app import bearer, client_of, running, token_of
from tests.server.station_parts import OpenStation

Figures = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def figures_of(text: str) -> Figures:
    """Return every figure of a scrape by name and sorted labels; each stands there once."""
    found: Figures = {}
    for family in text_string_to_metric_families(text):
        assert family.documentation, family.name
        for sample in family.samples:
            key = (sample.name, tuple(sorted(sample.labels.items())))
            assert key not in found, key
            found[key] = sample.value
    return found


async def scraped(client: httpx.AsyncClient) -> Figures:
    answer = await client.get("/metrics")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    return figures_of(answer.text)


def labels_of(figures: Figures, name: str, label: str) -> set[str]:
    return {dict(labels)[label] for found, labels in figures if found == name}


async def test_a_scrape_tells_every_robot_of_the_fleet(client: StationClient, world: World):
    world.tell(state_report(MINI, battery_fraction=0.625))

    async def is_told() -> Figures | None:
        figures = await scraped(client)
        return figures if ("grace_robot_battery_ratio", (("robot", MINI),)) in figures else None

    figures = await until(is_told)
    assert figures is not None
    assert figures["grace_robot_battery_ratio", (("robot", MINI),)] == 0.625
    assert 0.0 <= figures["grace_robot_state_age_seconds", (("robot", MINI),)] < 60.0
    assert labels_of(figures, "grace_robot_link_state", "robot") >= {MINI, GRACE}


async def test_a_scrape_tells_the_parts_of_the_station(client: StationClient):
    figures = await scraped(client)
    names = {name for name, _ in figures}
    assert names >= {
        "grace_build_info", "grace_writer_queue_rows", "grace_writer_fault",
        "grace_writer_transaction_seconds_bucket", "grace_event_loop_tasks",
        "grace_event_loop_lag_seconds_count", "grace_worker_processes", "grace_live_viewers",
        "grace_alarms_standing", "grace_notices_waiting", "grace_database_size_bytes",
        "grace_disk_free_bytes", "process_cpu_seconds_total", "process_open_fds",
    }  # fmt: skip
    assert figures["grace_writer_fault", ()] == 0.0
    assert figures["grace_database_size_bytes", ()] > 0.0
    assert not [name for name, _ in figures if name == "grace_metrics_failures_total"]


async def test_the_process_is_told_of_where_only_processes_are_seen_of_proc(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    proc = tmp_path / "proc"  # as ProcSubset=pid of systemd leaves it
    proc.mkdir()
    (proc / "self").symlink_to("/proc/self")
    begin = ProcessCollector.__init__
    monkeypatch.setattr(ProcessCollector, "__init__", partialmethod(begin, proc=str(proc)))
    async with running(tmp_path, metrics_on_loopback=True) as app, client_of(app) as anyone:
        figures = await scraped(anyone)
    assert figures["process_resident_memory_bytes", ()] > 0.0
    assert figures["process_open_fds", ()] > 0.0
    assert 0.0 < figures["process_start_time_seconds", ()] <= time.time()


async def test_requests_are_counted_by_the_template_of_their_route(client: StationClient):
    for robot in (MINI, GRACE):
        await client.get(f"/api/robots/{robot}/state")
    await client.get("/api/robots/nobody/state")
    await client.get("/no/such/page?token=grace_secret")
    figures = await scraped(client)
    route = ("route", "/api/robots/{robot}/state")
    name = "grace_http_requests_total"
    assert figures[name, (("method", "GET"), route, ("status", "200"))] == 2
    assert figures[name, (("method", "GET"), route, ("status", "404"))] == 1
    assert figures["grace_http_request_duration_seconds_count", (route,)] == 3
    told = labels_of(figures, name, "route")
    assert not [one for one in told if "nobody" in one or "no/such" in one]


async def test_methods_that_strangers_make_up_are_counted_as_one(tmp_path):
    async with running(tmp_path, metrics_on_loopback=True) as app, client_of(app) as anyone:
        for made_up in ("BREW", "M1", "M2", "M3", "M4"):
            assert (await anyone.request(made_up, "/api/health")).status_code == 405
        figures = await scraped(anyone)
    assert labels_of(figures, "grace_http_requests_total", "method") == {"other"}
    assert (
        sum(value for (name, _), value in figures.items() if name == "grace_http_requests_total")
        == 5
    )


async def test_a_change_is_timed_by_the_writer(client: StationClient, station: OpenStation):
    before = await scraped(client)
    await station.foundation.store.write(lambda session: None)
    after = await scraped(client)
    key = ("grace_writer_transaction_seconds_count", (("kind", "change"),))
    assert after[key] >= before.get(key, 0.0) + 1


async def test_what_one_part_cannot_tell_does_not_silence_the_others(
    client: StationClient, station: OpenStation
):
    station.foundation.metrics.add(lambda: 1 / 0)  # type: ignore[arg-type]
    assert ("grace_writer_fault", ()) in await scraped(client)
    figures = await scraped(client)
    assert figures["grace_metrics_failures_total", (("part", __name__),)] >= 1
    assert ("grace_writer_fault", ()) in figures


async def test_a_scrape_that_the_database_does_not_answer_has_no_figures_of_another(
    tmp_path: Path,
):
    async with running(tmp_path) as app:
        foundation: Foundation = app.state.foundation
        answered, asked = asyncio.Event(), asyncio.Event()

        class Failing:
            async def query(self, read: Callable[[Session], object]) -> object:
                asked.set()
                await answered.wait()
                raise StoreUnavailableError("The database is away.")

        failing = asyncio.create_task(foundation.metrics.text(Failing()))  # type: ignore[arg-type]
        await asked.wait()
        whole = figures_of((await foundation.metrics.text(foundation.store)).decode())
        answered.set()
        rest = figures_of((await failing).decode())
    assert ("grace_database_size_bytes", ()) in whole
    assert ("grace_database_size_bytes", ()) not in rest
    assert ("grace_writer_fault", ()) in rest


async def test_rows_that_the_disk_bridges_are_told_and_why_it_takes_no_more(
    client: StationClient, station: OpenStation
):
    writer = station.foundation.store._writer
    figures = await scraped(client)
    assert figures["grace_writer_bridged_rows", ()] == 0.0
    assert figures["grace_writer_bridge_fault", ()] == 0.0
    writer.bridge_fault = "No space left on device"
    assert (await scraped(client))["grace_writer_bridge_fault", ()] == 1.0


async def test_metrics_need_a_token_that_may_see_the_whole_station(tmp_path):
    async with running(tmp_path) as app, client_of(app) as anyone:
        assert (await anyone.get("/metrics")).status_code == 401
        viewer = await token_of(app, Role.VIEWER)
        assert (await anyone.get("/metrics", headers=bearer(viewer))).status_code == 200
        nobody = await token_of(app, Role.NONE, "of chosen robots")
        assert (await anyone.get("/metrics", headers=bearer(nobody))).status_code == 403


async def test_who_read_the_figures_last_reads_them_while_the_database_is_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    async with running(tmp_path) as app, client_of(app) as anyone:
        access = app.state.foundation.services.get(Access)
        names = ("scraper", "another")
        scraper, other = [await token_of(app, Role.VIEWER, name) for name in names]

        async def away(_function: Callable[[Session], object]) -> None:
            raise StoreUnavailableError("The database is away.")

        async def status(token: str) -> int:
            return (await anyone.get("/metrics", headers=bearer(token))).status_code

        assert await status(scraper) == 200
        with monkeypatch.context() as patch:
            patch.setattr(app.state.foundation.store, "query", away)
            access._looks.clear()
            assert await status(scraper) == 200
            assert await status(other) == 503
            patch.setattr(access, "is_over", lambda _: True)
            assert await status(scraper) == 503
        assert await status(other) == 200


async def test_this_machine_needs_no_token_only_where_a_setting_says_so(tmp_path):
    async with running(tmp_path, metrics_on_loopback=True) as app:
        for address, status in (("127.0.0.1", 200), ("::1", 200), ("192.0.2.7", 401)):
            transport = httpx.ASGITransport(app, client=(address, 4711))
            async with httpx.AsyncClient(
                transport=transport, base_url="http://127.0.0.1:8000"
            ) as there:
                assert (await there.get("/metrics")).status_code == status, address


def test_behind_a_proxy_nobody_reads_metrics_without_a_token():
    with pytest.raises(ValidationError, match="metrics_on_loopback"):
        Settings(metrics_on_loopback=True, behind_proxy=True)


async def test_two_stations_in_one_process_count_apart(tmp_path):
    async with running(tmp_path / "a") as one, running(tmp_path / "b") as other:
        tokens = [await token_of(app, Role.VIEWER) for app in (one, other)]
        async with client_of(one, headers=bearer(tokens[0])) as first:
            await first.get("/api/session")
            figures = await scraped(first)
        async with client_of(other, headers=bearer(tokens[1])) as second:
            others = await scraped(second)
    asked = [
        key for key in figures if key[0] == "grace_http_requests_total" and "session" in str(key)
    ]
    assert asked
    assert not set(asked) & set(others)
