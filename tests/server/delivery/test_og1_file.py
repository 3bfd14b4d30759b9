"""Files of OG1.0: what is written stands there again, and nothing that lacks passes."""

import shutil
from dataclasses import replace
from datetime import timedelta

import netCDF4
import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.site import LAKE
from db.query.fleet.robots import add_robot
from db.query.measured.quality import ManualFlag
from db.store import Store
from robot_link.messages import STATE
from server.base.worker import WorkCancelledError
from server.delivery import field_check, file_task
from server.delivery.field_check import SUITES, field_checks
from server.delivery.file_task import kept_path
from server.delivery.judged import blocks_of
from server.delivery.og1_channel import OF_CHANNEL, TERMS
from server.delivery.og1_state import state_values
from server.delivery.own_check import ATTRIBUTES, VARIABLES, own_checks
from tests.db.conftest import START, robot_record
from tests.server.delivery.written import order_for, told

ROWS = 200
SAMPLED = tuple(key for key, one in CHANNELS.items() if one.kind == "field" and not one.is_derived)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A simulated robot with every channel of the catalogue, and one that exists with one."""
    folder = tmp_path_factory.mktemp("kept")
    url = f"sqlite:///{folder / 'station.sqlite3'}"
    store = Store.open(url)
    for name, number, kind in (("mini-1", 1, "simulated"), ("real-1", 2, "real")):
        record = robot_record(name, number, kind)
        store.change(lambda session, record=record: add_robot(session, record)).result()
    store.append(told(ROWS, SAMPLED)).result()
    store.append(told(ROWS, ("temperature",), "real-1")).result()
    yield store, url, folder / "delivery"
    store.close()


@pytest.fixture(scope="module")
def written(kept):
    store, url, folder = kept
    order = order_for(store, url, folder, "mini-1")
    news = []
    file = file_task.run(order, news.append, lambda: False)
    assert [share for share, _ in news] == sorted(share for share, _ in news)
    return order, file, kept_path(folder, file.sha256)


def test_every_field_channel_of_the_catalogue_has_its_row():
    assert {key for key, one in CHANNELS.items() if one.kind == "field"} == set(OF_CHANNEL)
    assert {one.name for one in OF_CHANNEL.values() if one.has_term} <= TERMS
    names = [one.name for one in OF_CHANNEL.values()]
    assert len(set(names)) == len(names)
    assert all(name == name.upper() for name in names)


def test_the_fields_own_checkers_and_ours_find_nothing(written):
    pytest.importorskip("compliance_checker", reason="compliance-checker is not installed")
    _, file, _ = written
    said = {one.suite: (one.state, one.findings, one.message) for one in file.checks}
    assert said == dict.fromkeys(("own", *SUITES), ("passed", (), ""))


def test_values_read_by_xarray_are_those_that_were_kept(written):
    """Times to the microsecond, places as kept, values to float32: seven digits."""
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    _, file, path = written
    with xarray.open_dataset(path) as dataset:
        assert dataset.sizes["N_MEASUREMENTS"] == file.rows == ROWS
        times = dataset["TIME"].values.astype("datetime64[us]").astype(np.int64)
        start_us = int(START.timestamp() * 1e6)
        assert (times - start_us).tolist() == [2_000_000 * row for row in range(ROWS)]
        for number, key in enumerate(SAMPLED):
            channel, found = CHANNELS[key], dataset[OF_CHANNEL[key].name].values
            middle = 10.0 if channel.low < 10.0 < channel.high else channel.high / 2.0
            rows = np.arange(0, ROWS, number + 1)
            assert found.dtype == np.float32
            expected = (middle + 0.001 * np.sin(rows)).astype(np.float32)
            assert np.array_equal(found[rows], expected), key
            assert np.isnan(np.delete(found, rows)).all(), key
        depth = 0.15 * (1.0 - np.cos(2.0 * np.pi * np.arange(ROWS) / 50.0)) + 0.001
        assert dataset["DEPTH"].values == pytest.approx(depth, abs=6e-4)
        fixes = np.isfinite(dataset["LATITUDE_GPS"].values)
        assert np.flatnonzero(fixes).tolist() == [0, 50, 100, 150]
        assert dataset["POSITION_SOURCE"].values[:3].tolist() == [1, 2, 2]
        assert dataset["FIDELITY_LEVEL"].attrs["thresholds_m"].tolist() == [0.1, 1.0]
        assert set(np.unique(dataset["PHASE"].values).tolist()) <= {1, 2, 3, 5}
        assert dataset["PHASE"].values[50] == 3
        assert dataset["PHASE"].values[62] == 2
        assert dataset["PHASE"].values[88] == 1


def test_a_robot_that_does_not_exist_says_so_everywhere(written):
    order, file, path = written
    assert file.name == "SIMULATION_mini-1_20261121T040000_R.nc"
    with netCDF4.Dataset(path) as found:
        assert found.id == order.identity
        assert str(found["TRAJECTORY"][...]).startswith("SIMULATION_")
        assert str(found["PLATFORM_SERIAL_NUMBER"][...]) == "SIMULATION_mini-1"
        assert found.title == "SIMULATION - Lake survey"
        assert found.comment.startswith("SIMULATION: this robot does not exist.")
        assert found.summary.startswith("SIMULATION: this robot does not exist.")
        assert found.is_simulated == "yes"


def test_what_follows_of_measurements_stands_where_temperature_was_measured(written):
    _, _, path = written
    with netCDF4.Dataset(path) as found:
        told = ~np.ma.getmaskarray(found["TEMP"][:])
        computed = ~np.ma.getmaskarray(found["DENSITY"][:])
        assert computed.any()
        assert not (computed & ~told).any()
        assert 990.0 < float(found["DENSITY"][:].mean()) < 1030.0
        assert "TEOS-10" in found["SA"].comment
        assert set(np.unique(found["DENSITY_QC"][:].compressed()).tolist()) <= {0, 1, 3}


def test_an_instrument_is_described_once_and_named_by_what_it_measures(written):
    _, _, path = written
    with netCDF4.Dataset(path) as found:
        sensors = [name for name in found.variables if name.startswith("SENSOR_")]
        assert sensors == ["SENSOR_CTD_SN_12"]
        assert {found[name].sensor for name in ("TEMP", "CNDC")} == set(sensors)
        assert "sensor" not in found["CHLA"].ncattrs()
        assert found[sensors[0]].sensor_calibration_date == "20260314"


def test_headings_of_files_are_from_true_north(kept, tmp_path):
    """At 50 km east of an origin at 43 deg north, 0.42 deg lie between the frame's and true."""
    store, url, folder = kept
    order = order_for(store, url, folder, "mini-1")
    site = LAKE.model_copy(update={"origin_latitude_deg": 43.0})
    deployment = replace(order.wanted.deployment, site=site)
    wanted = replace(order.wanted, deployment=deployment)
    with store.read() as session:
        block = next(blocks_of(session, wanted, lambda: False))
    far = block.position_ned.copy()
    far[:, :2] = (0.0, 50_000.0)
    heading = np.full(len(block), np.radians(-0.1))
    block = replace(block, position_ned=far, state={**block.state, "heading_rad": heading})
    assert state_values(block, "heading_rad", wanted) == pytest.approx(0.32, abs=0.005)
    told = replace(wanted, has_true_headings=True)
    assert state_values(block, "heading_rad", told) == pytest.approx(359.9)
    nowhere = replace(block, position_ned=np.full_like(far, np.nan))
    assert state_values(nowhere, "heading_rad", wanted) == pytest.approx(359.9)


def test_states_have_the_names_of_their_declaration(written):
    _, _, path = written
    with netCDF4.Dataset(path) as found:
        assert found["PITCH"].standard_name == STATE["pitch_rad"].standard_name
        assert found["ROLL"].standard_name == "platform_roll_starboard_down"
        assert found["HEADING"].comment == "Clockwise from true north."
        assert "standard_name" not in found["TAIL_ANGLE"].ncattrs()


def test_a_robot_that_exists_has_no_mark_and_people_come_first(kept):
    store, url, folder = kept
    at = START + timedelta(seconds=20)
    flag = ManualFlag("flag-1", "temperature", at, at + timedelta(seconds=8), 4, "Mud", at, "ann")
    order = order_for(store, url, folder, "real-1", manual=(flag,), mode="D", signed_by="ann")
    file = file_task.run(order, lambda _: None, lambda: False)
    assert file.name == "real-1_20261121T040000_D.nc"
    with netCDF4.Dataset(kept_path(folder, file.sha256)) as found:
        assert found.title == "Lake survey"
        assert (found.is_simulated, found.data_mode, found.signed_by) == ("no", "D", "ann")
        assert "signed by ann" in found.history
        flags = found["TEMP_QC"][:].tolist()
    assert flags[10:15] == [4] * 5
    assert set(flags[:10] + flags[15:]) <= {0, 1, 3}


def test_the_same_rows_make_the_same_file(written, kept):
    _, _, folder = kept
    order, file, _ = written
    again = file_task.run(replace(order, folder=folder / "again"), lambda _: None, lambda: False)
    assert (again.source_sha256, again.sha256) == (file.source_sha256, file.sha256)


@pytest.mark.parametrize("name", [*VARIABLES, *ATTRIBUTES])
def test_what_is_mandatory_is_named_when_it_is_missing(written, tmp_path, name):
    _, file, path = written
    broken = tmp_path / file.name
    copy_without(path, broken, name)
    assert {one.variable for one in own_checks(broken, file.name)} >= {name}
    assert all(one.fix for one in own_checks(broken, file.name))


def test_thirty_one_things_are_mandatory():
    assert len({*VARIABLES, *ATTRIBUTES}) == 31


@pytest.mark.parametrize(
    ("spoil", "check"),
    [
        (lambda file: file["TIME"].__setitem__(5, file["TIME"][4]), "time"),
        (lambda file: file["DEPTH"].__setitem__(3, -5.0), "depth"),
        (lambda file: file["TEMP_QC"].__setitem__(3, 7), "flags"),
        (
            lambda file: file["TEMP"].setncattr("vocabulary", "http://example.org/TEMP"),
            "vocabulary",
        ),
        (lambda file: file.setncattr("title", "Lake survey"), "marks"),
        (lambda file: file.setncattr("date_created", "2026-11-21T04:00:00Z"), "date"),
        (lambda file: file.setncattr("id", "another"), "name"),
        (lambda file: file.setncattr("contributor_email", " "), "mandatory"),
    ],
)
def test_a_file_that_was_spoilt_does_not_pass(written, tmp_path, spoil, check):
    _, file, path = written
    spoilt = tmp_path / file.name
    shutil.copyfile(path, spoilt)
    with netCDF4.Dataset(spoilt, "a") as found:
        found.set_auto_maskandscale(False)
        spoil(found)
    assert check in {one.check for one in own_checks(spoilt, file.name)}


@pytest.mark.parametrize("content", [b"", b"CDF", b"no file at all"])
def test_a_file_that_cannot_be_read_is_a_finding(tmp_path, content):
    path = tmp_path / "broken.nc"
    path.write_bytes(content)
    assert [one.check for one in own_checks(path, path.name)] == ["readable"]


def test_a_truncated_file_never_passes(written, tmp_path):
    _, file, path = written
    cut = tmp_path / file.name
    cut.write_bytes(path.read_bytes()[:-2000])
    assert own_checks(cut, file.name)


def test_a_checker_that_breaks_or_is_not_there_says_that_it_could_not_be_checked(
    written, tmp_path, monkeypatch
):
    _, _, path = written
    nothing = tmp_path / "nothing.nc"
    nothing.write_bytes(b"")
    assert {one.state for one in field_checks(nothing, lambda: False)} == {"unchecked"}
    slow = field_checks(path, lambda: False, limit_s=0.0)
    assert {one.state for one in slow} == {"unchecked"}
    monkeypatch.setattr(field_check, "_PACKAGES", ("a-package-that-is-not-there",))
    for one in field_checks(path, lambda: False):
        assert one.state == "unchecked"
        assert "are not installed" in one.message


@pytest.mark.parametrize("asked_before", [0, 1, 3])
def test_a_cancelled_file_leaves_nothing_behind(kept, asked_before):
    store, url, folder = kept
    order = order_for(store, url, folder / "cancelled", "mini-1")
    asked = iter(range(1000))
    with pytest.raises(WorkCancelledError):
        file_task.run(order, lambda _: None, lambda: next(asked) >= asked_before)
    assert list((folder / "cancelled").glob("*")) == []


SPOILT = ("TIME", "DEPTH", "LATITUDE", "LONGITUDE_GPS", "TEMP", "TEMP_QC", "HEADING", "PHASE")


@pytest.mark.parametrize("name", SPOILT)
def test_one_value_that_is_not_what_was_kept_is_one_finding(kept, monkeypatch, name):
    store, url, folder = kept
    monkeypatch.setattr(file_task, "field_checks", lambda *_: [])
    write = file_task.write_file

    def write_and_spoil(session, rows, path, *more):
        written = write(session, rows, path, *more)
        with netCDF4.Dataset(path, "a") as file:
            file.set_auto_maskandscale(False)
            file[name][0] = file[name][0] + 1
        return written

    monkeypatch.setattr(file_task, "write_file", write_and_spoil)
    order = order_for(store, url, folder / "spoilt", "mini-1")
    (own,) = file_task.run(order, lambda _: None, lambda: False).checks
    found = [(one.variable, one.message) for one in own.findings if one.check == "round_trip"]
    assert found == [(name, "1 value is not what was kept.")]


def test_a_disk_without_room_is_said_and_nothing_is_kept(kept, monkeypatch):
    store, url, folder = kept
    order = order_for(store, url, folder / "full", "mini-1")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(file_task, "write_file", full)
    with pytest.raises(ValueError, match=r"the disk did not take the file.*make room"):
        file_task.run(order, lambda _: None, lambda: False)
    assert list((folder / "full").iterdir()) == []


def copy_without(source, target, name):
    """Copy a file but for one variable or global attribute."""
    with netCDF4.Dataset(source) as old, netCDF4.Dataset(target, "w") as new:
        old.set_auto_maskandscale(False)
        new.setncatts({key: old.getncattr(key) for key in old.ncattrs() if key != name})
        for key, dimension in old.dimensions.items():
            new.createDimension(key, None if dimension.isunlimited() else len(dimension))
        for key, variable in old.variables.items():
            if key == name:
                continue
            told = {one: variable.getncattr(one) for one in variable.ncattrs()}
            fill = told.pop("_FillValue", None)
            made = new.createVariable(key, variable.dtype, variable.dimensions, fill_value=fill)
            made.set_auto_maskandscale(False)
            made.setncatts(told)
            made[...] = variable[...]
