"""Channels and readings in records: their bytes, what fits, and records of before."""

from contextlib import suppress
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.channel_table import ChannelPage, ChannelTable, TableRow, TableVersion
from robot_link.messages import LogId, OnboardPlanState
from robot_link.report import Reading
from robot_link.satellite.channel_code import ChannelPart, packed_channels, unpacked_channels
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader
from robot_link.satellite.record import (
    BEST_SIZES,
    MobileOriginatedContent,
    ShortPlanReport,
    compose,
    read_mobile_originated,
)
from tests.robot_link.satellite_case import KEY, NOW, ROBOT, SYSTEM, sample, state

ARRIVED = NOW + timedelta(minutes=5)
PLAN = ShortPlanReport("0123456789abcdef", OnboardPlanState.RUNNING, 11, 20, 12.345)
TABLE = ChannelTable.of(
    [
        TableRow(2, "chlorophyll", "ug/L", "field", 1.0),
        TableRow(64, "leak", "1", "switch", 30.0),
        TableRow(200, "methane", "nmol/L", "field", 2.5),
    ]
)
VERSION = TableVersion(ROBOT, TABLE.version, NOW, ARRIVED)
PAGE = ChannelPage(ROBOT, TABLE.version, LogId(3), 300, 0, 1, TABLE.rows, True, NOW, ARRIVED)
READINGS = tuple(
    Reading(ROBOT, key, value, NOW, ARRIVED)
    for key, value in (("leak", 0.0), ("internal_pressure", 950.0), ("#200", 1.5))
)
PART = ChannelPart(VERSION, PAGE, READINGS)
PART_HEX = (
    "07cec5e74d"  # all three; version
    "00000003ac02297381690000011902000a4002ac02c88019076d657468616e65066e6d6f6c2f4c"  # page
    "2973816900034000000041446d80c83fc000"  # readings
)
OLD_RECORD_HEX = (
    "130e0000000729738169000001e240fffe7e33000078000c8a05f60201f43d04fe3e007bcc4a86"
    "0123456789abcdef6000b014003039020000000307022973816900009a0c8e063ec41340900003"
    "00301700c4134090f6e183e00321c7d27d"
)


def read(data):
    return read_mobile_originated(data, KEY, SYSTEM, ROBOT, ARRIVED)


def unpacked(octets):
    return unpacked_channels(OctetReader(octets), ROBOT, NOW, ARRIVED)


def test_channels_and_readings_are_these_bytes():
    assert packed_channels(PART, 200).hex() == PART_HEX
    assert unpacked(bytes.fromhex(PART_HEX)) == PART


def test_a_record_of_before_is_read_and_written_as_before():
    content = MobileOriginatedContent(7, state(), PLAN, samples=(sample(0), sample(3)))
    assert compose(content, KEY, SYSTEM, 205).hex() == OLD_RECORD_HEX
    found = read(bytes.fromhex(OLD_RECORD_HEX))
    assert found.channels == ChannelPart()
    assert (found.plan, [one.sequence for one in found.samples]) == (PLAN, [0, 3])


@pytest.mark.parametrize("size", [*BEST_SIZES, 110, 160])
def test_a_record_says_of_channels_what_fits_and_keeps_the_rest(size):
    told = (sample(0), sample(3), sample(9, variable="#200"), sample(12, variable="leak"))
    content = MobileOriginatedContent(7, state(), PLAN, samples=told, channels=PART)
    record = compose(content, KEY, SYSTEM, size)
    assert len(record) <= size
    found = read(record)
    assert found.plan == PLAN
    assert (found.state is not None) == (size >= 70)
    assert (found.channels.page is not None) == (size > 100)
    if size >= 205:
        assert found.channels == PART
        assert {one.variable for one in found.samples} >= {"chlorophyll"}
    if size == 340:
        assert {one.variable for one in found.samples} == {"chlorophyll", "#200", "leak"}


def test_a_number_of_tomorrow_spoils_no_record():
    content = MobileOriginatedContent(7, state(), PLAN, samples=(sample(0, variable="#90"),))
    (told,) = read(compose(content, KEY, SYSTEM, 205)).samples
    assert told.variable == "#90"


@given(st.binary(max_size=80))
def test_no_other_bytes_end_in_anything_but_a_refusal(octets):
    with suppress(WireError):
        unpacked(octets)


@pytest.mark.parametrize("octets", ["00", "08", "02", "0300000000", "01ff", "04"])
def test_a_part_that_cannot_be_is_refused(octets):
    with pytest.raises(WireError):
        unpacked(bytes.fromhex(octets))
