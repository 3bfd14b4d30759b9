"""What a tag receiver writes, and what is not believed of it."""

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.tag.receiver_line import (
    HeardLine,
    LineFault,
    ReceiverLineError,
    StatusLine,
    read_line,
    written_line,
)

AT = datetime(2026, 7, 1, 9, 30, 17, tzinfo=UTC)
HEARD = b"450052,005,2026-07-01 09:30:17,A69-1601,179,#6F\r\n"
SENSOR = b"450052,006,2026-07-01 09:31:02,A69-9002,4711,87,#35\r\n"
STATUS = b"450052,007,2026-07-01 10:00:00,STS,DC=39,PC=326,LV=12.0,T=8.6,#FE\r\n"


def fault_of(line: bytes) -> LineFault:
    with pytest.raises(ReceiverLineError) as caught:
        read_line(line)
    return caught.value.fault


def summed(body: bytes) -> bytes:
    return body + b",#%02X\r\n" % (sum(body) & 0xFF)


def test_a_detection_says_tag_and_time():
    assert read_line(HEARD) == HeardLine(450052, 5, AT, "A69-1601-179", None)


def test_a_tag_with_a_sensor_says_its_value():
    read = read_line(SENSOR)
    assert isinstance(read, HeardLine)
    assert (read.tag, read.sensor) == ("A69-9002-4711", 87)


def test_the_receiver_tells_its_own_condition():
    read = read_line(STATUS)
    assert isinstance(read, StatusLine)
    assert read.values == {"DC": "39", "PC": "326", "LV": "12.0", "T": "8.6"}


def test_a_sum_in_small_letters_is_one():
    assert read_line(HEARD.replace(b"#6F", b"#6f")) == read_line(HEARD)


@pytest.mark.parametrize(
    "line",
    [
        HEARD.replace(b"179", b"178"),
        HEARD.replace(b"#6F", b"#70"),
        b"",
        b"\xff\x00",
        b"#6F",
        HEARD[:30],
    ],
)
def test_a_line_whose_sum_is_wrong_is_not_believed(line):
    assert fault_of(line) is LineFault.SUM


@pytest.mark.parametrize("clock", [b"2026-02-30 09:30:17", b"2026-07-01 24:30:17", b"", b"now"])
def test_a_date_that_is_none_is_not_believed(clock):
    assert fault_of(summed(b"450052,005," + clock + b",A69-1601,179")) is LineFault.DATE


@pytest.mark.parametrize("info", [b"XYZ", b"A69-1601", b"A69-1601,", b"A69,179", b"STSX,DC=1", b""])
def test_what_is_neither_a_tag_nor_a_condition_is_an_unknown_code(info):
    assert fault_of(summed(b"450052,005,2026-07-01 09:30:17," + info)) is LineFault.CODE


@given(
    st.integers(1, 999_999),
    st.integers(0, 999),
    st.datetimes(datetime(2000, 1, 1), datetime(2099, 1, 1)),  # noqa: DTZ001 - made aware below
    st.integers(1, 65_535),
    st.none() | st.integers(0, 65_534),
)
def test_what_is_written_is_read_as_it_was(receiver, sequence, at, code, sensor):
    at = at.replace(microsecond=0, tzinfo=UTC)
    line = HeardLine(receiver, sequence, at, f"A69-1601-{code}", sensor)
    assert read_line(written_line(line)) == line


@given(st.binary(max_size=80))
def test_garbage_is_refused_with_its_reason(line):
    with pytest.raises(ReceiverLineError):
        read_line(line)
