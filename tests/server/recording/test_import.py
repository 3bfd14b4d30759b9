"""Recorded deployments come in whole or not at all, and go out as they came."""

import asyncio
import io
import math
import threading
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from sqlalchemy import event as sqlalchemy_event

from autonomy.channel import CHANNELS
from db.query.fleet.robots import add_robot, get_robot
from db.query.measured import imported
from db.query.measured.maps import newest_maps
from db.query.measured.telemetry import history, newest_state, track
from server.recording import keep, table
from server.recording.map_fit import FitProblem, run
from server.recording.table import Policy, read_recording
from tests.db.conftest import report, robot_record, sample

HOUR = timedelta(hours=1)
REAL = Path(__file__).parents[4] / "shared" / "data" / "eva035_chl_temp.csv"


def dive_csv(rows=60, broken=(), start_s=1_563_751_502):
    """One yo of a glider in a field that falls with depth."""
    lines = ["time,latitude,longitude,depth,chlorophyll"]
    for row in range(rows):
        depth_m = 40.0 * math.sin(math.pi * row / rows)
        value = 3.0 * math.exp(-depth_m / 20.0) + 0.01 * math.sin(row)
        cells = [start_s + 30.1 * row, 48.9 + 1e-4 * row, -130.6 + 5e-5 * row, depth_m, value]
        lines.append(",".join("oops" if row in broken else repr(cell) for cell in cells))
    return "\n".join(lines) + "\n"


async def import_file(client, text, robot="eva", **form):
    answer = await client.post(
        "/api/imports",
        data={"robot": robot, **form},
        files={"file": ("dive.csv", io.BytesIO(text.encode()))},
    )
    assert answer.status_code == 202, answer.text
    async with asyncio.timeout(200):
        while True:
            job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
            if job["state"] not in {"queued", "running"}:
                return job
            await asyncio.sleep(0.1)


async def test_an_import_becomes_a_robot_a_track_samples_and_a_map(app, pilot):
    job = await import_file(pilot, dive_csv())
    assert (job["state"], job["progress"]) == ("done", 1.0), job["message"]
    result = job["result"]
    assert (result["deployment"], result["rows"], result["skipped"]) == ("deployment-1", 60, [])
    [score] = result["scores"]
    assert (score["variable"], score["unit"]) == ("chlorophyll", "ug/L")
    assert 0 < score["rmse"] < 1.0
    with app.state.foundation.store.read() as session:
        robot = get_robot(session, "eva")
        points = track(session, "eva").points
        assert len(history(session, "eva", "chlorophyll").value) == 60
        assert newest_state(session, "eva") is None
        [field_map] = newest_maps(session, "eva")
    assert (robot.kind, robot.site.kind) == ("recorded", "sea")
    assert len(points) == 60
    assert all(robot.site.water.contains(*point.position_ned) for point in points)
    north_m = points[-1].position_ned[0] - points[0].position_ned[0]
    assert north_m == pytest.approx(59e-4 * 111_200, rel=0.01)
    assert field_map.document["scores"]["held_out"] == score["held_out"]
    kinds = [e["kind"] for e in (await pilot.get("/api/events?robot=eva")).json()["events"]]
    assert kinds == ["deployment.imported", "deployment.mapped"]


async def test_a_file_with_broken_rows_is_refused_whole_unless_told_to_skip(app, pilot):
    text = dive_csv(broken=(3, 10))
    job = await import_file(pilot, text)
    assert job["state"] == "failed"
    assert job["message"].startswith("2 rows are broken, the first in line 5")
    assert [error["line"] for error in job["result"]["errors"]] == [5, 12]
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    job = await import_file(pilot, text, policy="skip")
    assert (job["state"], job["result"]["rows"]) == ("done", 58)
    assert [fault["line"] for fault in job["result"]["skipped"]] == [5, 12]
    [deployment] = (await pilot.get("/api/deployments")).json()["deployments"]
    assert (deployment["samples"], deployment["skipped_rows"]) == (58, 2)


async def test_the_same_file_twice_is_one_deployment(pilot):
    text = dive_csv(rows=10)
    assert (await import_file(pilot, text))["state"] == "done"
    again = await import_file(pilot, text)
    assert again["state"] == "failed"
    assert again["message"] == "This recording is there already, as deployment-1 of eva."
    later = await import_file(pilot, dive_csv(rows=10, start_s=1_600_000_000))
    assert later["result"]["deployment"] == "deployment-2"


async def test_too_few_samples_make_no_map_and_that_is_said(pilot):
    result = (await import_file(pilot, dive_csv(rows=10)))["result"]
    assert result["scores"] == []
    assert result["without_map"][0]["reason"].startswith("a map needs at least 20 samples")


async def test_nothing_is_kept_when_the_last_row_cannot_be_written(app, pilot, monkeypatch):
    """The rows go in one transaction: a failure at the end takes the begin with it."""

    def fail(*args, **kwargs):
        raise RuntimeError("on purpose")

    monkeypatch.setattr(keep, "add_event", fail)
    job = await import_file(pilot, dive_csv())
    assert job["state"] == "failed"
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    assert (await pilot.get("/api/config/planner?robot=eva")).status_code == 404


async def test_a_name_that_no_robot_can_have_is_refused_at_its_field(pilot):
    answer = await pilot.post(
        "/api/imports", data={"robot": "../Eva"}, files={"file": ("d.csv", b"x")}
    )
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["robot"]


async def test_a_deployment_goes_out_as_it_came_in(app, pilot):
    await import_file(pilot, dive_csv(rows=10))
    answer = await pilot.get("/api/deployments/deployment-1/export")
    assert answer.headers["content-disposition"] == 'attachment; filename="eva_deployment-1.csv"'
    job = await import_file(pilot, answer.text, robot="again")
    assert job["result"]["rows"] == 10
    with app.state.foundation.store.read() as session:
        first, second = (history(session, robot, "chlorophyll") for robot in ("eva", "again"))
        tracks = [track(session, robot).points for robot in ("eva", "again")]
    assert first == second
    for one, other in zip(*tracks, strict=True):
        assert one.position_ned == pytest.approx(other.position_ned, abs=0.01)


async def test_the_track_goes_out_for_maps(pilot):
    await import_file(pilot, dive_csv(rows=10))
    feature = (await pilot.get("/api/deployments/deployment-1/export?format=geojson")).json()
    longitude, latitude, height = feature["geometry"]["coordinates"][0]
    assert (longitude, latitude, height) == pytest.approx((-130.6, 48.9, 0.0), abs=1e-6)
    assert feature["properties"]["simulation"] is False
    kml = (await pilot.get("/api/deployments/deployment-1/export?format=kml")).text
    assert "-130.6000000,48.9000000,-0.00" in kml
    wrong = await pilot.get("/api/deployments/deployment-1/export?format=netcdf")
    assert wrong.status_code == 422


async def test_samples_go_out_for_maps_with_the_values_of_their_channels(pilot):
    await import_file(pilot, dive_csv(rows=10))
    path = "/api/deployments/deployment-1/export?values=true"
    found = (await pilot.get(f"{path}&format=geojson")).json()
    assert found["properties"]["simulation"] is False
    assert found["properties"]["units"]["chlorophyll"] == "ug/L"
    assert len(found["features"]) == 10
    first = found["features"][0]
    assert first["geometry"]["coordinates"] == pytest.approx((-130.6, 48.9, 0.0), abs=1e-6)
    csv = (await pilot.get("/api/deployments/deployment-1/export")).text.splitlines()
    keys, cells = (line.split(",") for line in csv[-11:-9])
    written = dict(zip(keys, cells, strict=True))
    assert first["properties"]["chlorophyll"] == float(written["chlorophyll"])
    assert datetime.fromisoformat(first["properties"]["time"]).timestamp() == pytest.approx(
        float(written["time"])
    )
    tree = ET.fromstring((await pilot.get(f"{path}&format=kml")).text)
    kml = "{http://www.opengis.net/kml/2.2}"
    marks = tree.findall(f".//{kml}Placemark")
    assert len(marks) == 10
    [value] = [one for one in marks[0].iter(f"{kml}SimpleData") if one.get("name") == "chlorophyll"]
    assert float(value.text) == float(written["chlorophyll"])
    titles = [one.text for one in tree.iter(f"{kml}displayName")]
    assert "Chlorophyll, ug/L" in titles


async def test_what_a_simulated_robot_measured_is_marked_wherever_it_goes(app, pilot):
    store = app.state.foundation.store
    await store.write(lambda session: add_robot(session, robot_record()))
    measured = [sample(0), sample(1), replace(sample(1, variable="temperature"), sequence=2)]
    await asyncio.wrap_future(store.append([report(0), report(1), *measured]))
    [deployment] = (await pilot.get("/api/deployments?robot=mini-1")).json()["deployments"]
    assert (deployment["kind"], deployment["samples"]) == ("live", 3)
    assert deployment["variables"] == ["blue_light", "temperature"]
    path = f"/api/deployments/{deployment['id']}/export"
    csv = await pilot.get(path)
    assert "SIMULATION_mini-1" in csv.headers["content-disposition"]
    lines = csv.text.splitlines()
    assert lines[0] == "# SIMULATION: this robot does not exist"
    assert [line.rsplit(",", 2)[1:] for line in lines[-2:]] == [["3.0", ""], ["3.0", "3.0"]]
    feature = (await pilot.get(f"{path}?format=geojson")).json()
    assert feature["properties"]["simulation"] is True
    for more in ("", "&values=true"):
        assert "<name>SIMULATION: " in (await pilot.get(f"{path}?format=kml{more}")).text


async def test_a_deployment_counts_what_it_gives_away(app, pilot):
    store = app.state.foundation.store
    record = robot_record()
    await store.write(lambda session: add_robot(session, record))
    before = replace(
        sample(0), sequence=7, variable="temperature", measured_at=record.created_at - HOUR
    )
    await asyncio.wrap_future(store.append([report(0), sample(0), sample(1), before]))
    [deployment] = (await pilot.get("/api/deployments?robot=mini-1")).json()["deployments"]
    csv = (await pilot.get(f"/api/deployments/{deployment['id']}/export")).text
    names, *rows = [line for line in csv.splitlines() if not line.startswith("#")]
    assert (deployment["samples"], deployment["variables"]) == (len(rows), ["blue_light"])
    assert "temperature" not in names


def test_maps_are_fitted_until_the_work_is_called_off():
    values = {"chlorophyll": [], "temperature": []}
    problem = FitProblem([[0.0, 0.0, 0.0]], values, dict(CHANNELS))
    assert run(problem, lambda news: None, lambda: True) == []


@pytest.mark.skipif(not REAL.exists(), reason="the SeaExplorer recording is not on this machine")
async def test_a_real_glider_comes_in(app, pilot):
    """Every sample is read; every tenth is imported, for the map's sake."""
    with REAL.open("rb") as file:
        recording = read_recording(file, REAL.stat().st_size, Policy.REFUSE, CHANNELS)
    assert len(recording.time_s) == 5044
    assert recording.depth_m.max() == pytest.approx(705.17)
    header, *rows = REAL.read_text().splitlines()
    job = await import_file(pilot, "\n".join([header, *rows[::10]]), robot="eva035")
    assert job["state"] == "done", job["message"]
    scores = {score["variable"]: score for score in job["result"]["scores"]}
    assert set(scores) == {"chlorophyll", "temperature"}
    assert all(score["rmse_in_std"] < 1.0 for score in scores.values())
    with app.state.foundation.store.read() as session:
        depths = history(session, "eva035", "depth_m", max_points=100)
    assert max(depths.value) > 690.0


async def test_deployments_are_listed_in_one_look_that_reads_no_samples(app, pilot):
    """What they need is kept; a station has millions of samples, and they would take seconds."""
    await import_file(pilot, dive_csv(rows=20))
    await import_file(pilot, dive_csv(rows=20, start_s=1_563_761_502))
    store = app.state.foundation.store
    await store.write(lambda session: add_robot(session, robot_record()))
    store.append([sample(0), sample(1)]).result(60)
    statements = []

    def note(connection, cursor, statement, *rest):
        statements.append(statement)

    sqlalchemy_event.listen(store._read_engine, "before_cursor_execute", note)
    listed = (await pilot.get("/api/deployments")).json()["deployments"]
    sqlalchemy_event.remove(store._read_engine, "before_cursor_execute", note)
    assert [deployment["samples"] for deployment in listed] == [2, 20, 20]
    about = [said for said in statements if "deployment" in said or "sample" in said]
    assert about
    counted = [said for said in about if "count(" in said]
    assert all("measured_at >=" in said and "measured_at <" in said for said in counted)


@pytest.mark.parametrize("step", ["reading", "keeping"])
async def test_an_import_that_is_cancelled_stops_and_keeps_nothing(app, pilot, monkeypatch, step):
    """Cancelled in the middle, it has let go of its file and of the writer when that is said."""
    begun, let_go = threading.Event(), threading.Event()

    def slowly(items):
        for number, item in enumerate(items):
            if number == 2:
                begun.set()
                let_go.wait(60)
            yield item

    def held(*more):
        begun.set()
        let_go.wait(60)
        insert_samples(*more)

    lines, insert_samples = table._lines, imported.insert_samples
    if step == "reading":
        monkeypatch.setattr(table, "_lines", lambda *more: slowly(lines(*more)))
    else:
        monkeypatch.setattr(imported, "insert_samples", held)
    answer = await pilot.post(
        "/api/imports",
        data={"robot": "eva"},
        files={"file": ("dive.csv", io.BytesIO(dive_csv().encode()))},
    )
    job = answer.json()["id"]
    await asyncio.to_thread(begun.wait, 60)
    cancelling = asyncio.create_task(pilot.delete(f"/api/jobs/{job}"))
    await until_cancelled(f"import {job}")
    let_go.set()
    assert (await cancelling).json()["state"] == "cancelled"
    assert (await pilot.get("/api/deployments")).json()["deployments"] == []
    assert (await import_file(pilot, dive_csv()))["state"] == "done"


async def until_cancelled(name):
    """Wait until a task has been told to end."""
    async with asyncio.timeout(60):
        while True:
            if any(t.get_name() == name and t.cancelling() for t in asyncio.all_tasks()):
                return
            await asyncio.sleep(0.005)
