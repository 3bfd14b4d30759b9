"""Tables of channels: their octets, their pages, what contradicts the catalogue, and the radio."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.channel import CHANNELS, Channel
from autonomy.unit_text import is_same_unit
from robot_link.channel_table import (
    ChannelPage,
    ChannelTable,
    TableAssembler,
    TableRow,
    contradictions,
    difference,
    pages,
    row_octets,
    rows_of,
)
from robot_link.clock import SystemClock
from robot_link.mavlink.channel_page import channel_page, page_messages
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.decode import decoded
from robot_link.mavlink.wire import grace
from robot_link.messages import LinkState, LogId, Sample, SystemId
from robot_link.sample_log import SampleKey
from tests.robot_link.rig import MINI, rig, until
from tests.robot_link.target_case import NOW

SINCE = SampleKey(LogId(7), 40)
DELIVERED = [
    TableRow(one.wire_number, one.key, one.unit, one.kind, 1.0)
    for one in CHANNELS.values()
    if one.wire_number
]
ALL = ChannelTable.of(DELIVERED)
METHANE = TableRow(200, "methane", "nmol/L", "field", 2.5)
RADIO = 255
PAGES = len(page_messages(ALL, SINCE, NOW, RADIO))

texts = st.text(st.characters(categories=("L", "N")), min_size=1, max_size=15)
rows = st.builds(
    TableRow,
    st.integers(1, 239),
    texts,
    texts,
    st.sampled_from(["field", "housekeeping", "switch"]),
    st.integers(0, 10**6).map(lambda tenths: tenths / 10),
)
tables = st.lists(rows, max_size=40, unique_by=lambda row: row.number).map(ChannelTable.of)


def radio_pages(table, payload=RADIO):
    return [
        channel_page(message, MINI, NOW) for message in page_messages(table, SINCE, NOW, payload)
    ]


def satellite_pages(table, room=60):
    cut = pages(table, room, is_short=True)
    return [
        ChannelPage(MINI, table.version, LogId(7), 40, n, len(cut), rows_of(one), True, NOW, NOW)
        for n, one in enumerate(cut)
    ]


@given(tables, st.randoms())
def test_a_table_arrives_whole_in_whatever_order_its_pages_come(table, random):
    for found in (radio_pages(table), satellite_pages(table, 130)):
        random.shuffle(found)
        put_together = TableAssembler()
        *first, last = found
        assert [put_together.add(page) for page in first] == [None] * len(first)
        assert put_together.add(last) == table


def test_every_delivered_channel_takes_three_bytes_by_satellite():
    assert sum(map(len, pages(ALL, 340, is_short=True))) == 3 * len(ALL.rows)
    assert PAGES <= 5


def test_octets_of_rows_are_as_written_down():
    assert row_octets(METHANE, is_short=True).hex() == "c88019076d657468616e65066e6d6f6c2f4c"
    assert row_octets(TableRow(64, "leak", "1", "switch"), is_short=True).hex() == "400200"
    assert row_octets(TableRow(64, "leak", "1", "switch"), is_short=False).hex() == (
        "40820004" + b"leak".hex() + "0131"
    )
    assert ChannelTable.of([METHANE]).version == 0x210A5413


def test_a_version_names_what_every_number_means():
    other = ChannelTable.of([replace(METHANE, unit="umol/L")])
    assert other.version != ChannelTable.of([METHANE]).version
    assert difference(ChannelTable.of([METHANE]), other) == (
        "number 200 was methane (nmol/L), is methane (umol/L)"
    )
    assert difference(ChannelTable.of([]), other) == "methane came"


def test_pages_that_are_not_the_announced_table_are_refused():
    first, *others = radio_pages(ALL)
    put_together = TableAssembler()
    put_together.add(replace(first, rows=first.rows[1:]))
    *others, last = others
    assert [put_together.add(page) for page in others] == [None] * len(others)
    with pytest.raises(ValueError, match="as put together"):
        put_together.add(last)


@pytest.mark.parametrize(
    "octets",
    ["00", "0183000001", "018f00", "018000ff", "7f0000", "01800002610a0131", "f08000016101"],
)
def test_octets_that_are_no_rows_are_refused(octets):
    with pytest.raises(ValueError, match=r"."):
        rows_of(bytes.fromhex(octets))


def test_a_page_that_cannot_be_is_refused():
    (message, *_) = page_messages(ALL, SINCE, NOW, RADIO)
    for name, value in (("page", 5), ("length", 201), ("version", 0)):
        broken = page_messages(ALL, SINCE, NOW, RADIO)[0]
        setattr(broken, name, value)
        with pytest.raises(ValueError, match="cannot be"):
            channel_page(broken, MINI, NOW)
    assert channel_page(message, MINI, NOW).sequence == 40


def test_a_number_is_given_once():
    with pytest.raises(ValueError, match="once"):
        ChannelTable.of([METHANE, replace(METHANE, key="radon")])


def test_what_a_row_says_otherwise_is_named_with_both_units():
    oxygen = TableRow(4, "dissolved_oxygen", "umol/L")
    salinity = TableRow(8, "salinity", "psu")
    heat = TableRow(3, "heat", "degC")
    found = contradictions(ChannelTable.of([oxygen, salinity, heat, METHANE]), CHANNELS)
    assert "Dissolved oxygen is told in umol/L; the catalogue has mg/L" in found[4]
    assert "heat to the robot and temperature" in found[3]
    assert "methane (number 200, nmol/L) is not in the catalogue" in found[200]
    assert 8 not in found
    own = CHANNELS.with_own([Channel("methane", "Methane", "nmol L-1", 200)])
    assert contradictions(ChannelTable.of([METHANE]), own) == {}


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("mg/L", "mg L-1"),
        ("°C", "degC"),
        ("umol m-2 s-1", "µmol/m2/s"),
        ("1", "psu"),
        ("%", "percent"),
    ],
)
def test_one_unit_may_be_written_in_several_ways(one, other):
    assert is_same_unit(one, other)
    assert is_same_unit(other, one)


@pytest.mark.parametrize(
    ("one", "other"),
    [("mg/L", "ug/L"), ("mg/L", "umol/L"), ("m", "m2"), ("degC", "K"), ("1", "x y z")],
)
def test_units_of_another_size_are_others(one, other):
    assert not is_same_unit(one, other)


async def test_a_robot_announces_its_channels_when_the_link_begins_and_when_they_change(tmp_path):
    async with rig(tmp_path) as it:
        robot = it.robots[MINI].link
        robot.announce(ALL)
        async with it.station() as (_, heard):
            put_together = TableAssembler()

            def whole():
                told = [put_together.add(page) for page in heard.of(ChannelPage)]
                return [table for table in told if table]

            await until(lambda: ALL in whole())
            number = robot.record_sample("leak", 0.0, (1.0, 1.0, 1.0), 0.1, SystemClock().now())
            changed = ChannelTable.of([*ALL.rows, METHANE])
            robot.announce(changed)
            await until(lambda: changed in whole())
            since = {one.version: one.sequence for one in heard.of(ChannelPage)}
            assert since == {ALL.version: 0, changed.version: number + 1}
            robot.record_sample("#200", 3.5, (1.0, 1.0, 1.0), 0.1, SystemClock().now())
            await until(lambda: [s for s in heard.of(Sample) if s.variable == "#200"])


async def test_a_station_asks_for_the_page_that_it_missed(tmp_path):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        robot = it.robots[MINI].link
        lost = []
        send = robot.channels._send

        async def lossy(page):
            if page.page == 2 and not lost:
                lost.append(page)
            else:
                await send(page)

        robot.channels._send = lossy
        robot.announce(ALL)
        await until(lambda: {page.page for page in heard.of(ChannelPage)} == set(range(PAGES)))
        assert lost


async def test_a_station_that_does_not_know_the_message_hears_all_else(tmp_path, monkeypatch):
    async with rig(tmp_path) as it, it.station() as (station, heard):
        await until(lambda: station.link_report(MINI).state is LinkState.LIVE)
        monkeypatch.delitem(grace.mavlink_map, grace.MAVLINK_MSG_ID_GRACE_CHANNELS)
        robot = it.robots[MINI].link
        robot.announce(ALL)
        robot.record_sample("leak", 0.0, (1.0, 1.0, 1.0), 0.1, SystemClock().now())
        await until(lambda: not robot.unacknowledged_samples)
        assert heard.of(Sample)
        assert not heard.of(ChannelPage)
        assert station.link_report(MINI).state is LinkState.LIVE


def test_a_message_of_tomorrow_tells_nothing_today(monkeypatch):
    robot = Codec(SystemId(1), ROBOT_COMPONENT)
    frame = robot.pack(page_messages(ALL, SINCE, NOW, RADIO)[0])
    (told,), bad = robot.unpack(frame)
    assert (decoded(told, MINI, NOW).version, bad) == (ALL.version, 0)
    monkeypatch.delitem(grace.mavlink_map, grace.MAVLINK_MSG_ID_GRACE_CHANNELS)
    messages, _ = robot.unpack(frame)
    assert [decoded(message, MINI, NOW) for message in messages] in ([], [None])
