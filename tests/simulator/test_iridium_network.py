import asyncio
from dataclasses import replace
from datetime import timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.satellite import cost as fare
from simulator.iridium.acceptance import Reason, RefusedError
from simulator.iridium.conditions import SatelliteConditions
from simulator.iridium.message_queue import CAPACITY, MessageQueue, QueuedMessage
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.session import MobileOriginatedStatus, MobileTerminatedStatus, Place
from simulator.iridium.subscriber import credit_count
from tests.robot_link.rig import until
from tests.simulator.iridium import IMEI, QUICK, STARTED_AT, HandClock, network_of

SURELY = 1.0


def message(number: int, priority: int = 5, queued_at=STARTED_AT) -> QueuedMessage:
    return QueuedMessage(number, number, b"x", priority, queued_at, queued_at)


async def queued(network: IridiumNetwork, *contents: bytes) -> None:
    for content in contents:
        network.accept(IMEI, content)
        await asyncio.sleep(0)
    network.clock.advance(seconds=60)


# ---- the queue ------------------------------------------------------------------------------


def test_queue_serves_priorities_first_and_is_first_in_first_out_within_them():
    queue = MessageQueue()
    for number, priority in ((1, 5), (2, 3), (3, 5), (4, 1), (5, 3)):
        queue.put(message(number, priority))
    assert [m.message_id for m in queue] == [4, 2, 5, 1, 3]


def test_full_queue_drops_the_oldest_of_its_lowest_priority():
    queue = MessageQueue()
    for number in range(1, CAPACITY + 1):
        queue.put(message(number, 4 if number % 2 else 5))
    assert queue.put(message(100, 4)) == 26
    assert len(queue) == CAPACITY
    assert 2 not in [m.message_id for m in queue]
    assert 1 in [m.message_id for m in queue]


def test_full_queue_refuses_what_is_less_urgent_than_all_that_it_holds():
    queue = MessageQueue()
    for number in range(CAPACITY):
        queue.put(message(number, 1))
    assert not queue.has_room(5)
    with pytest.raises(OverflowError, match="higher priority"):
        queue.put(message(100, 5))
    assert len(queue) == CAPACITY


@settings(deadline=None, max_examples=50)
@given(st.lists(st.integers(1, 5), max_size=200))
def test_queue_holds_the_newest_of_the_most_urgent(priorities: list[int]):
    queue, expected = MessageQueue(), []
    for number, priority in enumerate(priorities):
        lowest = max((p for p, _ in expected), default=0)
        if len(expected) == CAPACITY and priority > lowest:
            assert not queue.has_room(priority)
            continue
        if len(expected) == CAPACITY:
            expected.remove(next(entry for entry in expected if entry[0] == lowest))
        expected = sorted([*expected, (priority, number)])
        assert queue.put(message(number, priority)) == expected.index((priority, number)) + 1
    assert [(m.priority, m.message_id) for m in queue] == expected


def test_purge_takes_every_message_of_a_modem_when_one_is_too_old():
    purge_at = STARTED_AT.replace(hour=0, minute=6, second=14) + timedelta(days=6)
    queue = MessageQueue()
    queue.sweep(STARTED_AT)
    queue.put(message(1, queued_at=STARTED_AT))
    queue.put(message(2, queued_at=purge_at - timedelta(minutes=1)))
    assert queue.sweep(purge_at - timedelta(seconds=1)) == 0
    assert queue.sweep(purge_at) == 2


def test_purge_spares_messages_that_are_not_five_days_old():
    queue = MessageQueue()
    queue.sweep(STARTED_AT)
    queue.put(message(1, queued_at=STARTED_AT))
    assert queue.sweep(STARTED_AT + timedelta(days=5)) == 0


def test_purge_spares_what_came_after_it_however_late_somebody_looks():
    purge_at = STARTED_AT.replace(hour=0, minute=6, second=14) + timedelta(days=6)
    queue = MessageQueue()
    queue.sweep(STARTED_AT)
    queue.put(message(1, queued_at=STARTED_AT))
    queue.put(message(2, queued_at=purge_at + timedelta(hours=1)))
    assert queue.sweep(purge_at + timedelta(days=2)) == 1
    assert [m.message_id for m in queue] == [2]


async def test_network_purges_by_the_robots_clock():
    network, _ = network_of(clock=HandClock())
    await queued(network, b"one")
    network.clock.advance(days=7)
    assert (await network.session(IMEI, None)).mt_data is None
    assert network.waiting(IMEI) == ()


# ---- sessions -------------------------------------------------------------------------------


async def test_session_fetches_one_message_and_tells_how_many_remain():
    network, _ = network_of(clock=HandClock())
    await queued(network, b"one", b"two", b"three")
    results = [await network.session(IMEI, None) for _ in range(4)]
    assert [r.mt_data for r in results] == [b"one", b"two", b"three", None]
    assert [r.queued for r in results] == [2, 1, 0, 0]
    assert [r.mtmsn for r in results] == [1, 2, 3, 0]
    assert [r.mt_status for r in results] == [1, 1, 1, 0]
    assert [r.momsn for r in results] == [0, 1, 2, 3]


async def test_message_is_not_in_the_queue_before_its_transit_is_over():
    network, _ = network_of(clock=HandClock())
    network.accept(IMEI, b"one")
    assert (await network.session(IMEI, None)).mt_data is None
    network.clock.advance(seconds=3)
    assert (await network.session(IMEI, None)).mt_data == b"one"


async def test_gateway_is_told_of_a_session_with_place_time_and_both_numbers():
    network, told = network_of(clock=HandClock())
    await queued(network, b"down")
    await network.session(IMEI, b"up", Place(42.7, -84.5))
    await until(lambda: told)
    (report,) = told
    assert (report.momsn, report.mtmsn, report.data) == (0, 1, b"up")
    assert report.session_at == network.clock.now()
    assert abs(report.latitude_deg - 42.7) < 0.2
    assert abs(report.longitude_deg + 84.5) < 0.2


async def test_modem_that_sees_no_sky_finds_no_network():
    network, told = network_of(in_view=lambda _imei: False)
    result = await network.session(IMEI, b"up")
    assert result.mo_status == MobileOriginatedStatus.NO_NETWORK
    assert not result.is_ok
    assert told == []
    assert network.signal(IMEI) == 0


async def test_outage_ends_when_its_conditions_are_replaced():
    network, _ = network_of(replace(QUICK, outage=True), clock=HandClock())
    assert (await network.session(IMEI, b"up")).mo_status == MobileOriginatedStatus.NO_NETWORK
    network.conditions = QUICK
    assert (await network.session(IMEI, b"up")).is_ok


async def test_modem_that_dives_in_a_session_loses_the_link():
    is_up = True
    network, told = network_of(in_view=lambda _imei: is_up)
    session = asyncio.ensure_future(network.session(IMEI, b"up"))
    await asyncio.sleep(0)
    is_up = False
    assert (await session).mo_status == MobileOriginatedStatus.LINK_LOST
    assert told == []


async def test_two_sessions_of_a_modem_at_once_are_one_too_many():
    network, _ = network_of()
    first, second = await asyncio.gather(network.session(IMEI, b"a"), network.session(IMEI, b"b"))
    assert first.is_ok
    assert second.mo_status == MobileOriginatedStatus.BUSY


async def test_unknown_or_detached_modem_is_denied_and_too_long_a_message_is_not_sent():
    network, _ = network_of()
    assert (await network.session("3" * 15, b"a")).mo_status == 15
    assert (await network.session(IMEI, bytes(341))).mo_status == 12
    network.subscriber(IMEI).is_attached = False
    assert (await network.session(IMEI, b"a")).mo_status == 15


# ---- what goes wrong -------------------------------------------------------------------------


async def test_lost_message_leaves_the_queue_and_the_modem_knows_that_something_failed():
    network, _ = network_of(replace(QUICK, loss=SURELY), clock=HandClock())
    await queued(network, b"one")
    result = await network.session(IMEI, None)
    assert (result.mt_status, result.mt_data) == (MobileTerminatedStatus.ERROR, None)
    assert network.waiting(IMEI) == ()


async def test_duplicated_message_comes_again_under_its_old_number():
    network, told = network_of(replace(QUICK, duplication=SURELY), clock=HandClock())
    await queued(network, b"one")
    results = [await network.session(IMEI, b"up") for _ in range(2)]
    assert [(r.mtmsn, r.mt_data) for r in results] == [(1, b"one")] * 2
    await until(lambda: len(told) >= 4)
    assert sorted(m.momsn for m in told) == [0, 0, 1, 1]


async def test_reordered_message_is_overtaken():
    network, _ = network_of(replace(QUICK, reordering=SURELY), clock=HandClock())
    await queued(network, b"one", b"two", b"three")
    first = await network.session(IMEI, None)
    assert first.mt_data in (b"two", b"three")


async def test_broken_session_keeps_its_number_so_that_a_repetition_can_be_told():
    network, told = network_of(replace(QUICK, mobile_originated_loss=SURELY), seed=3)
    results = [await network.session(IMEI, b"up") for _ in range(30)]
    broken = [r for r in results if not r.is_ok]
    await until(lambda: len(told) >= len(broken))
    assert {r.mo_status for r in broken} == {MobileOriginatedStatus.LINK_LOST}
    for before, after in pairwise(results):
        assert after.momsn == before.momsn + before.is_ok
    with_data = [m for m in told if m.data]
    assert 0 < len(with_data) < len(results)
    assert {m.session_status for m in told if not m.data} == {13}
    assert len(with_data) + sum(not m.data for m in told) == len(broken)


async def history(seed: int) -> list[object]:
    bad = replace(
        QUICK, loss=0.4, mobile_originated_loss=0.4, duplication=0.1, reordering=0.3, ring=False
    )
    network, _ = network_of(bad, seed=seed, clock=HandClock())
    await queued(network, *(bytes((n,)) for n in range(8)))
    return [await network.session(IMEI, bytes((n,))) for n in range(12)]


async def test_same_seed_gives_the_same_history():
    assert await history(7) == await history(7)
    assert await history(7) != await history(8)


# ---- rings -----------------------------------------------------------------------------------


async def test_waiting_message_rings_twice():
    rings: list[float] = []
    network, _ = network_of(clock=HandClock())
    network.on_ring(IMEI, lambda: rings.append(1.0))
    network.accept(IMEI, b"one")
    network.clock.advance(seconds=3)
    await until(lambda: len(rings) == 2)
    await asyncio.sleep(0.05)
    assert len(rings) == 2


async def test_fetched_message_does_not_ring_again():
    rings: list[float] = []
    # a session that takes no time is over before the second ring, however late the loop is
    network, _ = network_of(replace(QUICK, session_s=0.0), clock=HandClock())
    network.on_ring(IMEI, lambda: rings.append(1.0))
    network.accept(IMEI, b"one")
    network.clock.advance(seconds=3)
    assert (await network.session(IMEI, None)).mt_data == b"one"
    await asyncio.sleep(0.1)
    assert len(rings) <= 1


async def test_message_right_behind_another_does_not_ring_itself():
    rings: list[float] = []
    network, _ = network_of(replace(QUICK, jitter_s=0.0), clock=HandClock())
    network.on_ring(IMEI, lambda: rings.append(1.0))
    for content in (b"one", b"two", b"three"):
        network.accept(IMEI, content)
    network.clock.advance(seconds=3)
    await until(lambda: len(rings) == 2)
    await asyncio.sleep(0.05)
    assert len(rings) == 2


@pytest.mark.parametrize("reason", ["submerged", "ring disabled", "rings off", "outage"])
async def test_modem_that_cannot_hear_is_not_rung(reason: str):
    rings: list[float] = []
    conditions = replace(QUICK, ring=reason != "rings off", outage=reason == "outage")
    is_up = reason != "submerged"
    network, _ = network_of(conditions, clock=HandClock(), in_view=lambda _imei: is_up)
    network.subscriber(IMEI).is_ring_enabled = reason != "ring disabled"
    network.on_ring(IMEI, lambda: rings.append(1.0))
    network.accept(IMEI, b"one")
    network.clock.advance(seconds=3)
    await asyncio.sleep(0.1)
    assert rings == []


# ---- bills -----------------------------------------------------------------------------------


def test_every_message_costs_what_the_station_quotes():
    assert [credit_count(n) for n in range(341)] == [fare.credits(n) for n in range(341)]


async def test_modem_is_charged_for_each_message_that_was_taken():
    network, _ = network_of()
    for size in (270, 176, 50):
        network.accept(IMEI, bytes(size))
    assert network.credits_charged[IMEI] == 6 + 4 + 1
    await network.session(IMEI, bytes(51))
    assert network.mobile_originated_credits[IMEI] == 2
    assert network.credits_charged[IMEI] == 11


async def test_account_without_enough_credit_sends_nothing():
    network, _ = network_of()
    network.subscriber(IMEI).account.credits_left = 5
    with pytest.raises(RefusedError, match="credit") as refusal:
        network.accept(IMEI, bytes(270))
    assert refusal.value.reason is Reason.NO_CREDIT
    network.accept(IMEI, bytes(250))
    assert network.subscriber(IMEI).account.credits_left == 0
    assert len(network.waiting(IMEI)) == 1


@pytest.mark.parametrize(
    ("data", "mtmsn", "reason"),
    [
        (b"", None, Reason.EMPTY),
        (bytes(271), None, Reason.TOO_LONG),
        (b"x", 0, Reason.BAD_MTMSN),
        (b"x", 65536, Reason.BAD_MTMSN),
    ],
)
async def test_refused_message_costs_nothing_and_flushes_nothing(data, mtmsn, reason):
    network, _ = network_of()
    network.accept(IMEI, b"before")
    with pytest.raises(RefusedError) as refusal:
        network.accept(IMEI, data, mtmsn=mtmsn, flush=True)
    assert refusal.value.reason is reason
    assert network.credits_charged[IMEI] == 1
    assert len(network.waiting(IMEI)) == 1


async def test_flush_deletes_what_waits_before_the_new_message():
    network, _ = network_of(clock=HandClock())
    await queued(network, b"old", b"older")
    network.accept(IMEI, b"new", flush=True)
    assert [m.data for m in network.waiting(IMEI)] == [b"new"]


async def test_numbers_wrap_where_the_modem_has_sixteen_bits():
    network, _ = network_of(clock=HandClock())
    line = network._lines[IMEI]
    line.mtmsn, line.momsn = 65535, 65535
    await queued(network, b"one")
    first = await network.session(IMEI, None)
    second = await network.session(IMEI, None)
    assert (first.momsn, first.mtmsn, second.momsn) == (65535, 1, 0)


def test_imei_must_be_one_and_unique():
    network, _ = network_of()
    with pytest.raises(ValueError, match="15 digits"):
        network.add_subscriber("12", network.subscriber(IMEI).account)
    with pytest.raises(ValueError, match="known already"):
        network.add_subscriber(IMEI, network.subscriber(IMEI).account)


# ---- restarts --------------------------------------------------------------------------------


async def test_network_goes_on_where_its_process_ended(tmp_path: Path):
    clock, file = HandClock(), tmp_path / "network.json"
    before, _ = network_of(clock=clock, memory_file=file, listens=False)
    before.subscriber(IMEI).account.credits_left = 100
    await queued(before, b"\x00\xff" * 40, b"two", b"three")
    first = await before.session(IMEI, b"up", Place(42.7, -84.5))
    await asyncio.sleep(0.02)

    after, told = network_of(clock=clock, memory_file=file, seed=2)
    assert [m.data for m in after.waiting(IMEI)] == [b"two", b"three"]
    assert after.credits_charged == before.credits_charged == {IMEI: 4}
    assert after.mobile_originated_credits == {IMEI: 1}
    await until(lambda: told)
    assert [(m.data, m.momsn, m.session_at) for m in told] == [(b"up", 0, clock.now())]
    second = await after.session(IMEI, None)
    assert (first.momsn, second.momsn) == (0, 1)
    assert (first.mtmsn, second.mtmsn) == (1, 2)
    assert after.accept(IMEI, b"four").message_id > told[0].record_id


async def test_message_that_was_taken_is_not_told_again_after_a_restart(tmp_path: Path):
    clock, file = HandClock(), tmp_path / "network.json"
    before, told_before = network_of(clock=clock, memory_file=file)
    await before.session(IMEI, b"up")
    await until(lambda: told_before)
    before.settle(told_before[0])
    _, told_after = network_of(clock=clock, memory_file=file)
    await asyncio.sleep(0.02)
    assert told_after == []


def test_memory_that_cannot_be_read_is_an_empty_one(tmp_path: Path, caplog):
    file = tmp_path / "network.json"
    file.write_bytes(b"{")
    network, _ = network_of(memory_file=file)
    assert network.waiting(IMEI) == ()
    assert "holds no memory" in caplog.text


def test_conditions_are_harmless_unless_somebody_asks():
    assert SatelliteConditions().loss == SatelliteConditions().duplication == 0.0
