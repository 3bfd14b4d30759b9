"""Exports of VUE: every row right, or named with its line."""

import io

import pytest

from server.tag.vue import COLUMNS, VueError, header, read_vue, written

HEAD = ",".join(COLUMNS)
GOOD = "2026-07-01 09:30:17,VR2C-480123,A69-1601-179,perch,1234,87,ADC,Jetty,48.5,-123.25"


def read(text: str | bytes):
    data = text.encode() if isinstance(text, str) else text
    return read_vue(io.BytesIO(data), len(data), lambda _: None)


def refusal(text: str | bytes) -> VueError:
    with pytest.raises(VueError) as caught:
        read(text)
    return caught.value


def test_an_export_is_read_as_it_was_written():
    rows = read(f"\ufeff{HEAD}\r\n{GOOD}\r\n")
    assert read(header() + written(rows[0])) == rows
    assert (rows[0].tag, rows[0].sensor, rows[0].place_deg) == (
        "A69-1601-179",
        87.0,
        (48.5, -123.25),
    )


def test_columns_are_found_by_name_and_most_may_lack():
    rows = read("Transmitter,Depth,Receiver,Date and Time (UTC)\nA69-1601-1,3,R,2026-07-01 09:30\n")
    assert (rows[0].receiver, rows[0].place_deg, rows[0].sensor) == ("R", None, None)


def test_the_origin_of_degrees_is_no_place():
    assert read(f"{HEAD}\n{GOOD.replace('48.5,-123.25', '0,0')}\n")[0].place_deg is None


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("2026-07-01 09:30:17", "01.07.2026 09:30"), "Date and Time"),
        (("2026-07-01", "2026-02-30"), "Date and Time"),
        (("2026-07-01", "1889-07-01"), "outside 1990"),
        (("A69-1601-179", "fish"), "Transmitter"),
        (("VR2C-480123", ""), "Receiver"),
        ((",87,", ",deep,"), "Sensor Value"),
        ((",87,", ",nan,"), "Sensor Value"),
        (("48.5", "98.5"), "Latitude"),
        (("48.5", ""), "belong together"),
        (("Jetty", "J" * 90), "Station Name"),
    ],
)
def test_a_broken_row_refuses_the_file_with_its_line(change, reason):
    error = refusal(f"{HEAD}\n{GOOD}\n{GOOD.replace(*change)}\n")
    assert [fault.line for fault in error.faults] == [3]
    assert reason in error.faults[0].reason
    assert "Nothing was imported" in str(error)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ("", "lacks the column"),
        (HEAD, "no detections"),
        ("time,latitude\n1,2\n", "lacks the column 'Date and Time (UTC)'"),
        (b"\xff\xfe\x00" + HEAD.encode("utf-16"), "zero byte"),
        (HEAD.encode() + b"\n\xe9\xe9,\n", "UTF-8"),
        (f'{HEAD}\n"{GOOD}\n', "no CSV"),
        (HEAD + "\n" + "x" * 20_000, "longer than"),
    ],
)
def test_what_is_no_export_is_refused(data, sentence):
    assert sentence in str(refusal(data))


def test_only_the_first_broken_rows_are_named():
    error = refusal(f"{HEAD}\n" + "x\n" * 300)
    assert len(error.faults) == 100
    assert "300 of 300" in str(error)
