"""Tables with any columns: what is found by itself, what is asked, and what is refused."""

import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from server.recording_file import csv_file
from server.recording_file.conversion import convert
from server.recording_file.depth import depth_of_pressure
from server.recording_file.mapping import MappingError, faults_of, proposed, questions
from server.recording_file.place_text import degrees_of, from_ddmm
from server.recording_file.raw import UnreadableError
from server.recording_file.unit import UnitError, converted
from tests.server.recording_file.reading_of import read, written

GERMAN = """# Bodensee
Date;Clock;Lat;Lon;Depth (cm);Temp [degF];Salz
03/04/2020;12:00:00;47° 30.0' N;9° 15.0' E;150;50,0;1,5
03/04/2020;12:00:02;47° 30.0' N;9° 15.0' E;160;50,9;1,6
"""


def table(folder, text, name="table.csv"):
    return read(folder, [written(folder, name, text)])


def changed(mapping, name, **update):
    columns = [
        one.model_copy(update=update) if one.name == name else one for one in mapping.columns
    ]
    return mapping.model_copy(update={"columns": tuple(columns)})


def faults(folder, *rows, header="time,latitude,longitude,depth,temperature"):
    raw = table(folder, "\n".join([header, *rows]) + "\n")
    found = convert(raw, proposed(raw, CHANNELS), CHANNELS)
    assert found.read == len(found.time_s) + len(found.faults)
    return [(one.place, one.reason) for one in found.faults]


def test_separator_decimal_comma_comments_units_and_angles_are_found(tmp_path):
    raw = table(tmp_path, GERMAN)
    mapping = proposed(raw, CHANNELS)
    roles = {one.name: (one.role, one.target, one.unit) for one in mapping.columns}
    assert roles["Depth (cm)"] == ("depth", "", "cm")
    assert roles["Temp [degF]"] == ("variable", "temperature", "degF")
    assert roles["Salz"][0] == "ignore"
    assert {one.field for one in questions(raw, mapping)} == {"time_format", "is_utc"}
    with pytest.raises(MappingError, match="is the day first, or the month"):
        convert(raw, mapping, CHANNELS)
    mapping = changed(mapping, "Salz", role="variable", target="salinity", unit="psu")
    found = convert(
        raw, mapping.model_copy(update={"time_format": "day_first", "is_utc": True}), CHANNELS
    )
    assert found.time_s.tolist() == [1585915200.0, 1585915202.0]
    assert found.latitude_deg == pytest.approx([47.5, 47.5])
    assert found.longitude_deg == pytest.approx([9.25, 9.25])
    assert found.depth_m == pytest.approx([1.5, 1.6])
    assert found.values["temperature"] == pytest.approx([10.0, 10.5])
    assert found.values["salinity"] == pytest.approx([1.5, 1.6])
    month = mapping.model_copy(update={"time_format": "month_first", "is_utc": True})
    assert convert(raw, month, CHANNELS).time_s[0] == 1583323200.0


def test_an_unknown_unit_blocks_its_column_alone(tmp_path):
    raw = table(tmp_path, "time,lat,lon,depth,temp (furlong)\n1600000000,1,2,3,4\n")
    mapping = proposed(raw, CHANNELS)
    assert faults_of(raw, mapping, CHANNELS).faults == [
        ("temp (furlong)", "the unit 'furlong' is not known; degC is needed")
    ]
    without = changed(mapping, "temp (furlong)", role="ignore")
    assert len(convert(raw, without, CHANNELS).time_s) == 1


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("1600000001,48,9,-5,10", "the depth is -5 m, above the surface"),
        ("1600000001,91,9,1,10", "the latitude is 91, outside -90 .. 90"),
        ("nan,48,9,1,10", "the time is missing"),
        ("1600000001,48,9,1,oops", "temperature is not a number: 'oops'"),
        ("1600000001,48,9,1", "the row has 4 cells, the header 5"),
        ("1600000000,48,9,1,11", "the time is that of line 2"),
        ("1600000001,48,9,,10", "no depth is told for this time"),
    ],
)
def test_a_row_that_is_wrong_is_named_by_its_line(tmp_path, row, reason):
    good = [f"16000000{second},48,9,1,10" for second in ("00", "02", "03", "04")]
    assert faults(tmp_path, good[0], row, *good[1:]) == [("line 3", reason)]


def test_a_unit_that_lies_is_doubted_as_a_whole(tmp_path):
    with pytest.raises(UnreadableError, match=r"3 of 3 values of temperature lie outside.*unit"):
        faults(tmp_path, *(f"160000000{row},48,9,1,283.1" for row in range(3)))


def test_a_depth_just_above_the_surface_is_the_surface_and_said_so(tmp_path):
    raw = table(tmp_path, "time,lat,lon,depth\n1600000000,1,2,-0.4\n1600000001,1,2,3\n")
    found = convert(raw, proposed(raw, CHANNELS), CHANNELS)
    assert found.depth_m.tolist() == [0.0, 3.0]
    assert found.notes == ("1 depths just above the surface became 0.",)


def test_pressure_becomes_depth_by_the_water_that_is_said(tmp_path):
    sea = depth_of_pressure(np.array([10_000.0]), np.array([30.0]), "sea")
    assert sea[0] == pytest.approx(9712.653, abs=1e-3)
    raw = table(tmp_path, "time,lat,lon,pressure (bar)\n1600000000,1,2,1\n")
    fresh = proposed(raw, CHANNELS).model_copy(update={"water": "fresh"})
    assert convert(raw, fresh, CHANNELS).depth_m == pytest.approx([10.197])


def test_bytes_that_are_no_recording_are_refused_with_a_sentence(tmp_path):
    for name, content, words in (
        ("empty.csv", b"", "is empty"),
        ("binary.csv", bytes(range(1, 200)) + b"\x00" * 50, "is no text"),
        ("numbers.csv", b"1,2\n3,4\n", "has no header"),
        ("cut.nc", b"CDF\x01" + b"\x00" * 40, "NetCDF"),
        ("cut.zip", b"PK\x03\x04" + b"\x00" * 40, "is no whole ZIP archive"),
    ):
        with pytest.raises(UnreadableError, match=words):
            read(tmp_path / "in", [written(tmp_path, name, content)])


def test_archives_are_unpacked_within_limits(tmp_path):
    bomb, outside, good = (tmp_path / name for name in ("bomb.zip", "outside.zip", "good.zip"))
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros.csv", b"0" * (5 << 20))
    with zipfile.ZipFile(outside, "w") as archive:
        archive.writestr("../../evil.csv", b"x")
    with zipfile.ZipFile(good, "w") as archive:
        archive.writestr("in/table.csv", "time,lat,lon,depth\n1600000000,1,2,3\n")
    with pytest.raises(UnreadableError, match="more than 50 times"):
        read(tmp_path / "a", [bomb])
    with pytest.raises(UnreadableError, match="leads outside"):
        read(tmp_path / "b", [outside])
    raw = read(tmp_path / "c", [good])
    assert (raw.files, len(raw)) == (("table.csv",), 1)


def test_files_of_several_kinds_are_several_imports(tmp_path):
    one = written(tmp_path, "a.csv", "time,lat,lon,depth\n1,2,3,4\n")
    two = written(tmp_path, "b.nc", b"CDF\x01" + b"\x00" * 40)
    with pytest.raises(UnreadableError, match="several imports"):
        read(tmp_path / "x", [one, two])


@given(st.floats(-89.9, 89.9))
def test_degrees_and_minutes_are_the_same_place(degrees):
    whole = np.trunc(abs(degrees))
    minutes = (abs(degrees) - whole) * 60.0
    ddmm = np.sign(degrees) * (100.0 * whole + minutes)
    assert from_ddmm(np.array([ddmm]))[0] == pytest.approx(degrees, abs=1e-9)
    side = "S" if degrees < 0.0 else "N"
    if minutes < 59.999:
        text = f"{whole:.0f} {minutes:.9f} {side}"
        assert degrees_of(text, is_ddmm=False) == pytest.approx(degrees, abs=1e-9)


def test_units_that_measure_different_things_are_not_confused():
    values = np.array([1.0])
    assert converted(values, "S/m", "mS/cm")[0] == 10.0
    assert converted(values, "mg m-3", "ug/L")[0] == 1.0
    assert converted(np.array([300.0]), "K", "degC")[0] == pytest.approx(26.85)
    with pytest.raises(UnitError, match="cannot become degC"):
        converted(values, "m", "degC")


def long_table(rows, broken=()):
    lines = ["time,lat,lon,depth,temp,note"]
    for row in range(rows):
        value = "oops" if row in broken else f"{10 + row / 100}"
        lines.append(f"{1600000000 + row},48,9,1,{value},word {row % 3}")
    return "\n".join(lines) + "\n"


def test_a_table_of_many_blocks_is_read_as_one_of_a_single_block(tmp_path, monkeypatch):
    whole = table(tmp_path / "whole", long_table(95, broken=(7, 30, 94)))
    monkeypatch.setattr(csv_file, "BLOCK_ROWS", 10)
    parts = table(tmp_path / "parts", long_table(95, broken=(7, 30, 94)))
    assert parts.faults == whole.faults
    assert [one.place for one in parts.faults] == ["line 9", "line 32", "line 96"]
    assert parts.row.tolist() == whole.row.tolist()
    for key, column in whole.columns.items():
        assert parts.columns[key].texts == column.texts
        assert parts.columns[key].values.tolist() == column.values.tolist()


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("ROWS_MAX", "has more than 50 rows; cut it into parts"),
        ("CELLS_MAX", "has more than 50 numbers; cut it into parts"),
        ("TEXTS_MAX", "has more than 50 cells with words; cut it into parts"),
        ("FAULTS_MAX", r"has more than 50 rows that cannot be read, the first is line 14: temp"),
    ],
)
def test_a_table_that_is_too_large_says_by_what(tmp_path, monkeypatch, limit, words):
    monkeypatch.setattr(csv_file, "BLOCK_ROWS", 10)
    monkeypatch.setattr(csv_file, limit, 50)
    broken = range(12, 90) if limit == "FAULTS_MAX" else ()
    with pytest.raises(UnreadableError, match=words):
        table(tmp_path, long_table(95, broken))
