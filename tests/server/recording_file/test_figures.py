"""Public files of other makers are read as they are: figures within their digits."""

import hashlib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from autonomy.channel import CHANNELS
from server.recording_file.conversion import convert
from server.recording_file.mapping import MappingError, proposed
from server.recording_file.raw import UnreadableError
from server.recording_file.reading import read_files
from server.recording_file.slocum import read_slocum
from tests.server.recording_file.reading_of import read

DATA = Path(__file__).parents[4] / "shared" / "data"
GLIDER = DATA / "glider"
BASE = "amadeus-2014-204-05-000"
CACHES = ("093bd5ed.cac", "468fd1be.cac", "61b1780f.cac", "dc76ebd5.cac")


def public(*names):
    """Return public files, or skip the test by the name of one that is not there."""
    found = [GLIDER / "cac" / name if name.endswith(".cac") else GLIDER / name for name in names]
    for path in found:
        if not path.exists():
            pytest.skip(f"{path.name} is not on this machine")
    return found


def recorded(tmp_path, *names):
    """Return the files as they were read, and converted as it is proposed."""
    if "NetCDF" in names[0] or names[0].endswith(".nc"):
        pytest.importorskip("netCDF4", reason="netCDF4 is not installed")
    raw = read(tmp_path, public(*names))
    return raw, convert(raw, proposed(raw, CHANNELS), CHANNELS)


@pytest.mark.parametrize(
    ("name", "sha256"),
    [
        ("p5420304.nc", "457f74f1cca579ca"),
        (f"{BASE}.dbd", "fd7c55aa6a5993e6"),
        (f"{BASE}.ebd", "ed6143e8bd18b85e"),
        (f"{BASE}.sbd", "1272d3013aec262a"),
        ("empty-2014-204-05-000.dbd", "e3b0c44298fc1c14"),
        ("sea076_20230906T0852_R.nc", "0d8424ba021f151d"),
        ("sp028_20230202T1637_R.nc", "6acec4bb6112e3e0"),
        ("../eva035_chl_temp.csv", "6eae5112017bce6b"),
    ],
)
def test_the_figures_are_those_of_these_very_files(name, sha256):
    (path,) = public(name)
    assert hashlib.sha256(path.read_bytes()).hexdigest()[:16] == sha256


def told(values):
    return values[np.isfinite(values)]


def test_the_glider_table(tmp_path):
    path = DATA / "eva035_chl_temp.csv"
    if not path.exists():
        pytest.skip(f"{path.name} is not on this machine")
    raw = read(tmp_path, [path])
    found = convert(raw, proposed(raw, CHANNELS), CHANNELS)
    assert (found.read, len(found.time_s), found.faults) == (5044, 5044, ())
    assert found.values["temperature"].mean() == pytest.approx(9.7073434179, abs=5e-11)
    assert found.values["chlorophyll"].mean() == pytest.approx(0.2913983148, abs=5e-11)
    assert found.time_s[[0, -1]].tolist() == [1563751502.7, 1563902862.1]


def test_a_dive_of_a_seaglider(tmp_path):
    raw, found = recorded(tmp_path, "p5420304.nc")
    assert (raw.format, len(raw), len(raw.fixes.time_s)) == ("seaglider", 1098, 3)
    assert found.read == len(found.time_s) == 1101
    assert told(found.values["temperature"]).mean() == pytest.approx(6.092372, abs=5e-7)
    salinity = told(found.values["salinity"])
    assert (len(salinity), salinity.mean()) == (1077, pytest.approx(34.227323, abs=5e-7))
    assert found.depth_m.max() == pytest.approx(1010.4065, abs=5e-5)
    times = raw.columns["time"].values
    assert times[[0, -1]] == pytest.approx([1454277934.861, 1454292580.891], abs=5e-4)
    assert int(np.isfinite(found.flight["position_std_m"]).sum()) == 3
    assert "sigma_theta" not in raw.columns
    assert raw.columns["eng_depth"].role == "ignore"


@pytest.mark.parametrize(
    ("ending", "sensor", "count", "mean"),
    [
        ("dbd", "m_depth", 897, 18.219396),
        ("ebd", "sci_water_temp", 1973, 16.443947),
        ("ebd", "sci_flntu_chlor_units", 3838, 1.392797),
        ("sbd", "m_depth", 67, 17.443007),
    ],
)
def test_sensors_of_a_slocum(ending, sensor, count, mean):
    path, *caches = public(f"{BASE}.{ending}", *CACHES)
    found = read_slocum(path, path.name, {one.stem: one for one in caches}, [sensor])
    values = told(found.values[sensor])
    assert (len(values), values.mean()) == (count, pytest.approx(mean, abs=5e-7))
    if ending == "dbd":
        assert found.sensors == 2027
        assert values.max() == pytest.approx(41.0549, abs=5e-5)


def test_the_times_of_a_slocum_and_that_its_short_file_repeats_the_long_one():
    long, short, *caches = public(f"{BASE}.dbd", f"{BASE}.sbd", *CACHES)
    by_sum = {one.stem: one for one in caches}
    asked = ["m_present_time", "m_depth"]
    found, sent = (read_slocum(path, path.name, by_sum, asked).values for path in (long, short))
    ends = [datetime.fromtimestamp(at, UTC) for at in found["m_present_time"][[0, -1]].tolist()]
    assert [f"{at:%Y-%m-%dT%H:%M:%SZ}" for at in ends] == [
        "2014-07-24T17:03:36Z",
        "2014-07-24T18:15:21Z",
    ]
    depths = dict(zip(found["m_present_time"].tolist(), found["m_depth"].tolist(), strict=True))
    is_told = np.isfinite(sent["m_depth"])
    pairs = zip(sent["m_present_time"][is_told], sent["m_depth"][is_told], strict=True)
    assert [depths[at] for at, _ in pairs] == sent["m_depth"][is_told].tolist()


def test_a_pair_of_a_slocum_is_one_recording(tmp_path):
    raw, found = recorded(tmp_path, f"{BASE}.dbd", f"{BASE}.ebd", *CACHES)
    fixes = told(raw.columns["fix latitude"].values)
    degrees = np.trunc(fixes / 100.0) + np.mod(fixes, 100.0) / 60.0
    assert (len(fixes), degrees.mean()) == (25, pytest.approx(54.262617, abs=5e-7))
    assert found.read == len(found.time_s) + len(found.faults)
    assert (told(found.values["temperature"]) > 14.0).all()
    assert told(found.values["pressure"]).max() == pytest.approx(40.74, abs=0.01)


def test_a_lone_half_is_read_with_a_warning_and_science_needs_a_place(tmp_path):
    raw, _ = recorded(tmp_path, f"{BASE}.sbd", *CACHES)
    assert raw.notes[0].startswith(f"{BASE}: the science file is not among the files")
    (science, *caches) = public(f"{BASE}.tbd", *CACHES)
    raw = read(tmp_path / "science", [science, *caches])
    assert raw.notes[0].startswith(f"{BASE}: the flight file is not among the files")
    mapping = proposed(raw, CHANNELS)
    with pytest.raises(MappingError, match="no column tells the latitude; say the place"):
        convert(raw, mapping, CHANNELS)
    said = mapping.model_copy(update={"latitude_deg": 54.26, "longitude_deg": 7.5})
    found = convert(raw, said, CHANNELS)
    assert found.read == len(found.time_s) + len(found.faults)
    assert len(found.time_s) > 0.9 * found.read
    assert set(found.latitude_deg.tolist()) == {54.26}
    assert any("rows tell no place and have the said 54.26000, 7.50000" in n for n in found.notes)
    half = mapping.model_copy(update={"latitude_deg": 54.26})
    with pytest.raises(MappingError, match="no column tells the longitude"):
        convert(raw, half, CHANNELS)


def test_files_that_are_no_slocum_files_are_refused_with_a_sentence(tmp_path):
    with pytest.raises(UnreadableError, match=r"Invalid DBD file: empty-.*it is empty"):
        read(tmp_path / "a", public("empty-2014-204-05-000.dbd"))
    with pytest.raises(UnreadableError, match=r"468fd1be\.cac is missing; add it to the upload"):
        read(tmp_path / "b", public(f"{BASE}.dbd"))
    (path,) = public(f"{BASE}.dbd")
    other = tmp_path / "other.dbd"
    other.write_bytes(path.read_bytes().replace(b"encoding_ver:    5", b"encoding_ver:    9"))
    with pytest.raises(UnreadableError, match=r"Invalid encoding version: other\.dbd says '9'"):
        read_files([(other.name, other)], tmp_path, lambda share: None)


def test_og1_of_others(tmp_path):
    raw, found = recorded(tmp_path / "sea", "sea076_20230906T0852_R.nc")
    assert (len(raw), len(told(raw.columns["DEPTH"].values))) == (10, 8)
    assert set(raw.columns["PHASE"].values.tolist()) == {3.0}
    assert raw.scalars["wmo_identifier"] == "6801665"
    assert found.values["temperature"].mean() == pytest.approx(18.702610, abs=5e-7)
    assert set(found.flags["temperature"].tolist()) == {1}
    raw, _ = recorded(tmp_path / "sp", "sp028_20230202T1637_R.nc")
    assert len(raw) == 372
    assert raw.columns["temp"].values.mean() == pytest.approx(10.413922, abs=5e-7)
    assert raw.columns["depth"].values.max() == pytest.approx(111.3673, abs=5e-5)
    times = raw.columns["time"].values
    assert (times.min(), times.max()) == pytest.approx((1675361294.999998, 1675456530.0), abs=1e-5)
