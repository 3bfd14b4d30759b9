"""A recorded deployment is read strictly: every row is right, or named with its line."""

import contextlib
import io
import math
import sys
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from server.recording import table
from server.recording.table import Policy, RecordingError, RowFault, ascending, read_recording

HEADER = "time,latitude,longitude,depth,chlorophyll\n"
GOOD = ["1000,48.9,-130.6,0.5,0.37", "1030,48.9,-130.6,4.0,0.41", "1060,48.9,-130.6,8.0,0.55"]


def read(text, policy=Policy.SKIP, **more):
    data = text.encode() if isinstance(text, str) else text
    return read_recording(io.BytesIO(data), len(data), policy, CHANNELS, **more)


def with_row(row, at=2):
    rows = [*GOOD]
    rows.insert(at, row)
    return HEADER + "\n".join(rows) + "\n"


def test_a_clean_file_is_read_as_it_is():
    recording = read(HEADER + "\n".join(GOOD) + "\n", Policy.REFUSE)
    assert recording.time_s.tolist() == [1000.0, 1030.0, 1060.0]
    assert recording.latitude_deg.tolist() == [48.9] * 3
    assert recording.longitude_deg.tolist() == [-130.6] * 3
    assert recording.depth_m.tolist() == [0.5, 4.0, 8.0]
    assert recording.values["chlorophyll"].tolist() == [0.37, 0.41, 0.55]
    assert recording.skipped == ()


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("1040,48.9,-130.6,1.0", "the row has 4 cells, the header 5"),
        ("1040,48.9,-130.6,1.0,0.3,9", "the row has 6 cells, the header 5"),
        ("1040,48.9,-130.6,1.0,", "chlorophyll is empty"),
        ("1040,48.9,-130.6,1.0,low", "chlorophyll is not a number: 'low'"),
        ("1040,48.9,-130.6,1.0,nan", "chlorophyll is not finite: 'nan'"),
        ("1040,48.9,-130.6,inf,0.3", "depth is not finite: 'inf'"),
        ("1040,48.9,-130.6,-0.1,0.3", "depth is -0.1, outside 0 .. 11000"),
        ("1040,90.5,-130.6,1.0,0.3", "latitude is 90.5, outside -90 .. 90"),
        ("1040,48.9,-180.5,1.0,0.3", "longitude is -180.5, outside -180 .. 180"),
        ("1010000000000,48.9,-130.6,1.0,0.3", "time is 1.01e+12, outside 0 .. 4.1024"),
        ("2019-07-21T23:25:02Z,48.9,-130.6,1.0,0.3", "time is not a number: '2019-"),
        ("999,48.9,-130.6,1.0,0.3", "the time goes back behind line 3"),
        ("1030,48.9,-130.6,1.0,0.3", "the time is that of line 3"),
        ("1030,48.9,-130.6,4.0,0.41", "the row repeats line 3"),
        ("1040;48,9;-130,6;1,0;0,3", "time is not a number"),
    ],
)
def test_a_broken_row_is_named_with_its_line(row, reason):
    text = with_row(row)
    recording = read(text)
    [fault] = recording.skipped
    assert fault.line == 4
    assert fault.reason.startswith(reason)
    assert len(recording.time_s) == 3
    with pytest.raises(RecordingError, match="the first in line 4") as refused:
        read(text, Policy.REFUSE)
    assert refused.value.faults == (fault,)
    assert "Nothing was imported" in str(refused.value)


def test_lines_are_counted_as_an_editor_counts_them():
    text = f"# a comment\n{HEADER}\n{GOOD[0]}\n\n# another\nbroken\n{GOOD[1]}\n"
    recording = read(text)
    assert recording.skipped == (RowFault(7, "the row has 1 cells, the header 5"),)
    assert len(recording.time_s) == 2


def test_a_jump_of_the_clock_costs_one_row_and_not_all_that_follow():
    recording = read(with_row("5000,48.9,-130.6,1.0,0.3"))
    assert recording.skipped == (RowFault(4, "the time is ahead of line 5, which follows"),)
    assert recording.time_s.tolist() == [1000.0, 1030.0, 1060.0]


@given(st.lists(st.integers(0, 20), max_size=12))
def test_the_fewest_rows_are_left_out_for_their_time(times):
    kept = [times[index] for index in ascending(times)]
    assert kept == sorted(set(kept))
    longest = max(
        (
            size
            for size in range(len(times) + 1)
            for part in combinations(times, size)
            if all(a < b for a, b in pairwise(part))
        ),
        default=0,
    )
    assert len(kept) == longest


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_line_endings_quotes_and_a_byte_order_mark_mean_nothing(ending):
    rows = [HEADER.strip(), '"1000","48.9","-130.6","0.5","0.37"', GOOD[1]]
    recording = read(("\ufeff" + ending.join(rows)).encode())
    assert recording.skipped == ()
    assert recording.time_s.tolist() == [1000.0, 1030.0]


def test_bytes_that_are_no_text_break_their_row_only():
    data = (
        HEADER.encode() + GOOD[0].encode() + b"\n10\xff10,48.9,-130.6,1.0,0.3\n" + GOOD[1].encode()
    )
    recording = read(data)
    assert [fault.line for fault in recording.skipped] == [3]
    assert len(recording.time_s) == 2


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ("", "must name the columns"),
        ("lat,lon,time,depth,chlorophyll", "must name the columns"),
        ("time,latitude,longitude,depth", "There is no variable"),
        ("time,latitude,longitude,depth,unheard_of", "'unheard_of' is unknown"),
        ("time,latitude,longitude,depth,temperature,temperature", "appears twice"),
    ],
)
def test_a_header_that_does_not_fit_refuses_the_file(header, sentence):
    with pytest.raises(RecordingError, match=sentence):
        read(header + "\n" + GOOD[0])


def test_a_file_without_a_row_that_can_be_used_is_refused():
    with pytest.raises(RecordingError, match="no row that can be used"):
        read(HEADER)
    with pytest.raises(RecordingError, match="no row that can be used") as refused:
        read(HEADER + "x\n")
    assert len(refused.value.faults) == 1


def test_a_count_of_light_must_have_a_logarithm():
    text = "time,latitude,longitude,depth,blue_light\n1,2,3,4,0\n2,2,3,4,10\n"
    assert read(text).skipped == (RowFault(2, "blue_light is 0, but must exceed 0"),)


def test_progress_reaches_the_end():
    told = []
    rows = "".join(f"{second},48.9,-130.6,1.0,0.3\n" for second in range(3000))
    read(HEADER + rows, on_progress=told.append)
    assert told == sorted(told)
    assert told[-1] > 0.98
    assert len(told) <= 100


@given(st.binary(max_size=400))
def test_garbage_is_refused_and_never_crashes(data):
    for text in (data, HEADER.encode() + data):
        with contextlib.suppress(RecordingError):
            assert len(read(text).time_s) > 0


def test_columns_of_the_flight_come_in_si_and_may_have_gaps():
    header = "time,latitude,longitude,depth,pitch_deg,net_buoyancy_g,position_std_m\n"
    recording = read(f"{header}1000,48.9,-130.6,0.5,-90,12.5,\n1001,48.9,-130.6,0.6,,,0.05\n")
    assert recording.values == {}
    assert recording.flight["pitch_rad"][0] == pytest.approx(-math.pi / 2.0)
    assert recording.flight["net_buoyancy_kg"][0] == pytest.approx(0.0125)
    assert np.isnan(recording.flight["pitch_rad"][1])
    assert recording.flight["position_std_m"].tolist() == pytest.approx(
        [math.nan, 0.05], nan_ok=True
    )


def test_an_attitude_in_another_unit_breaks_its_row():
    header = "time,latitude,longitude,depth,pitch_deg\n"
    recording = read(f"{header}1000,48.9,-130.6,0.5,10\n1001,48.9,-130.6,0.6,1700\n")
    assert recording.skipped == (RowFault(3, "pitch_deg is 1700, outside -90 .. 90"),)


def steps(rows):
    """Count the steps of the interpreter in the module while rows of one time are read."""
    count = 0

    def trace(frame, event, argument):
        nonlocal count
        if frame.f_code.co_filename != table.__file__:
            return None
        frame.f_trace_opcodes = True
        count += event == "opcode"
        return trace

    text = HEADER + "10,48,-125,5,7\n" * rows
    before = sys.gettrace()
    sys.settrace(trace)
    try:
        recording = read(text)
    finally:
        sys.settrace(before)
    assert len(recording.skipped) == rows - 1
    return count


def test_the_work_grows_as_the_rows_and_not_faster():
    assert steps(800) < 8.5 * steps(100)


def test_a_file_of_more_rows_than_can_be_held_is_refused(monkeypatch):
    monkeypatch.setattr(table, "ROWS_MAX", 2)
    rows = [f"{second},48,-125,5,7\n" for second in range(3)]
    assert len(read(HEADER + "".join(rows[:2])).time_s) == 2
    with pytest.raises(RecordingError, match="more than 2 rows; cut it into parts"):
        read(HEADER + "".join(rows))
