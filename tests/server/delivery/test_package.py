"""Deliveries: one ZIP that others can check, open and read, the same for the same content."""

import csv
import io
import json
import shutil
import zipfile
from dataclasses import replace
from datetime import timedelta

import netCDF4
import numpy as np
import pytest

from db.query.fleet.robots import add_robot
from db.query.measured.quality import ManualFlag
from db.query.station.events import add_event
from db.store import Store
from server.base.worker import WorkCancelledError
from server.delivery import file_task
from server.delivery.file_task import kept_path
from server.delivery.package import task as package_task
from server.delivery.package.order import EarlierFile, PackageOrder
from server.delivery.package.task import package_path
from tests.db.conftest import START, robot_record
from tests.server.delivery.written import order_for, told

ROWS = 200
TOP = "SIMULATION_mini-1_20261121T040000_R"
FIXED = [
    *(f"netcdf/{TOP}.nc", "csv/samples.csv", "csv/states.csv", "csv/fixes.csv"),
    *("csv/columns.csv", "map/track.kml", "map/track.geojson", "log/logbook.html"),
    *("log/logbook.csv", "log/commands.csv", "log/events.csv", "meta/metadata.json"),
    *("meta/qc_rules.json", "meta/checks.json", "meta/config.json", "report/report.html"),
]


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """What is to be packed of a simulated robot, with a flag set by hand.

    What the checkers of the field say is asked in ``test_og1_file``.
    """
    folder = tmp_path_factory.mktemp("packed")
    url = f"sqlite:///{folder / 'station.sqlite3'}"
    store = Store.open(url)
    record = robot_record("mini-1", 1, "simulated")
    store.change(lambda session: add_robot(session, record)).result()
    store.append(told(ROWS, ("temperature", "chlorophyll"))).result()
    store.change(
        lambda session: add_event(
            session,
            START + timedelta(seconds=30),
            "robot.contact",
            "Ask bob@example.com, or ann@example.org.",
            robot="mini-1",
        )
    ).result()
    at = START + timedelta(seconds=20)
    flag = ManualFlag("flag-1", "temperature", at, at + timedelta(seconds=8), 4, "Mud", at, "ann")
    file = order_for(store, url, folder / "delivery", "mini-1", manual=(flag,))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(file_task, "field_checks", lambda *_: [])
        yield PackageOrder(file, None, has_journal=True, data_dir=folder)
    store.close()


@pytest.fixture(scope="module")
def packed(asked):
    news = []
    kept = package_task.run(asked, news.append, lambda: False)
    assert [share for share, _ in news] == sorted(share for share, _ in news)
    return kept, package_path(asked.file.folder, kept.sha256)


def test_a_bag_is_whole_for_those_who_made_the_format_and_not_with_a_byte_more(packed, tmp_path):
    bagit = pytest.importorskip("bagit", reason="bagit is not installed")
    _, path = packed
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        archive.extractall(tmp_path)
    bag = bagit.Bag(str(tmp_path / TOP))
    bag.validate()
    assert bag.info["External-Identifier"] == TOP
    assert bag.info["Contact-Email"] == "ann@example.org"
    with (tmp_path / TOP / "data/csv/samples.csv").open("a") as file:
        file.write(" ")
    with pytest.raises(bagit.BagValidationError):
        bag.validate()


def test_everything_is_in_it_in_one_order(packed):
    kept, path = packed
    with zipfile.ZipFile(path) as archive:
        names = [one.filename.removeprefix(f"{TOP}/") for one in archive.infolist()]
        times = {one.date_time for one in archive.infolist()}
    assert kept.name == f"{TOP}.zip"
    data = [one.removeprefix("data/") for one in names if one.startswith("data/")]
    assert sorted(data) == sorted([*FIXED, "raw/mini-1.tlog"])
    assert len(times) == 1


def test_the_same_content_makes_the_same_bytes_around_the_same_file(asked, packed):
    kept, _ = packed
    earlier = EarlierFile("file-1", kept.file, kept.file_order.written_at, "")
    later = asked.file.written_at + timedelta(days=3)
    again = replace(asked, file=replace(asked.file, written_at=later), earlier=earlier)
    second = package_task.run(again, lambda _: None, lambda: False)
    assert (second.is_new_file, second.sha256) == (False, kept.sha256)
    other = replace(kept.file, source_sha256="0" * 64)
    changed = replace(again, earlier=replace(earlier, kept=other))
    third = package_task.run(changed, lambda _: None, lambda: False)
    assert third.is_new_file
    assert third.sha256 != kept.sha256


def test_tables_read_back_as_the_numbers_of_the_netcdf_file(packed, tmp_path):
    _, path = packed
    with zipfile.ZipFile(path) as archive:
        rows = table(archive, "samples")
        columns = {row["name"] for row in table(archive, "columns") if row["file"] == "samples.csv"}
        archive.extract(f"{TOP}/data/netcdf/{TOP}.nc", tmp_path)
        fixes = table(archive, "fixes")
        states = table(archive, "states")
    assert set(rows[0]) == columns
    with netCDF4.Dataset(tmp_path / TOP / "data/netcdf" / f"{TOP}.nc") as file:
        temperature, flags = file["TEMP"][:], file["TEMP_QC"][:]
        depth, latitude = file["DEPTH"][:], file["LATITUDE"][:]
        assert np.array_equal(
            np.array([float(row["temperature_degC"]) for row in rows], dtype=np.float32),
            temperature,
        )
        assert [int(row["temperature_qc"]) for row in rows] == flags.tolist()
        assert [float(row["depth_m"]) for row in rows] == depth.tolist()
        assert [float(row["latitude_deg"]) for row in rows] == latitude.tolist()
        assert len(fixes) == np.ma.count(file["LATITUDE_GPS"][:])
    assert {row["mode"] for row in states} == {"gliding", "surfaced"}
    assert rows[0]["time_utc"] == "2026-11-21T04:00:00.000000Z"
    assert rows[1]["chlorophyll_ug_L"] == ""


def test_nothing_that_simulates_goes_unmarked(packed):
    _, path = packed
    with zipfile.ZipFile(path) as archive:
        for name in ("csv/samples.csv", "report/report.html", "map/track.kml", "log/logbook.html"):
            assert b"SIMULATION" in archive.read(f"{TOP}/data/{name}"), name
        assert json.loads(archive.read(f"{TOP}/data/meta/metadata.json"))["is_simulated"] is True


def test_no_address_leaves_but_those_of_the_contributors(packed):
    _, path = packed
    with zipfile.ZipFile(path) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    assert not [name for name, content in contents.items() if b"bob@example.com" in content]
    assert b"ann@example.org" in contents[f"{TOP}/data/log/events.csv"]


def test_the_report_says_what_was_found_by_shape_and_word(packed):
    _, path = packed
    with zipfile.ZipFile(path) as archive:
        page = archive.read(f"{TOP}/data/report/report.html").decode()
    assert 'class="bad"' in page
    assert "Mud" in page
    assert "http-equiv" in page
    assert "src=" not in page


def test_a_cancelled_delivery_leaves_nothing_behind(asked):
    folder = asked.file.folder.parent / "cancelled"
    order = replace(asked, file=replace(asked.file, folder=folder))
    asks = iter([False] * 6)
    with pytest.raises(WorkCancelledError):
        package_task.run(order, lambda _: None, lambda: next(asks, True))
    assert list(folder.iterdir()) == []


def test_a_disk_without_room_is_said_and_nothing_is_kept(asked, monkeypatch):
    folder = asked.file.folder.parent / "full"
    order = replace(asked, file=replace(asked.file, folder=folder))

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(package_task, "write_bag", full)
    with pytest.raises(ValueError, match=r"the disk did not take the delivery.*make room"):
        package_task.run(order, lambda _: None, lambda: False)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("part", ["table", "file", "ZIP"])
def test_a_disk_that_fills_while_a_part_is_written_keeps_nothing_of_it(asked, packed, part):
    """The system refuses to let any file grow beyond a size, as a full disk does."""
    resource = pytest.importorskip("resource", reason="the system has no limits of files")
    kept, path = packed
    with zipfile.ZipFile(path) as archive:
        rows = archive.getinfo(f"{TOP}/data/csv/samples.csv").file_size
    folder = asked.file.folder.parent / f"no room for a {part}"
    order = replace(asked, file=replace(asked.file, folder=folder))
    whole = set()
    if part == "ZIP":  # its file was written before
        whole = {kept_path(folder, kept.file.sha256)}
        folder.mkdir()
        shutil.copy(kept_path(asked.file.folder, kept.file.sha256), folder)
        earlier = EarlierFile("file-1", kept.file, kept.file_order.written_at, "")
        order = replace(order, earlier=earlier)
    size = {"table": rows // 2, "file": kept.file.bytes // 2, "ZIP": kept.file.bytes}[part]
    said = "file" if part == "file" else "delivery"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        with pytest.raises(ValueError, match=rf"the disk did not take the {said} .*make room"):
            package_task.run(order, lambda _: None, lambda: False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert set(folder.iterdir()) == whole


def table(archive, name):
    text = archive.read(f"{TOP}/data/csv/{name}.csv").decode()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(io.StringIO("\n".join(lines))))
