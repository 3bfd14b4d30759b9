"""Dives, rows and statistics of a deployment by REST."""

import asyncio
import csv
import io
import json
from datetime import datetime, timedelta

import numpy as np
import pytest

from autonomy.vehicle.battery import BATTERY_PRESETS, BatteryConfig
from server.access.role import Role
from server.analysis import analyses, answer
from server.analysis.progress import LINES
from server.base.worker import WorkerTaskError
from tests.server.analysis.conftest import DEEP_M, DIVE_S, DIVES, STEP_OF_CHARGE
from tests.server.conftest import MINI, api_client
from tests.server.delivery.test_quality_api import run
from tests.server.deployment.shore import answered


async def rows_of(client, path, **query):
    return await answered(client.get(f"{path}/analysis/rows", params=query))


async def test_every_dive_is_listed_with_what_it_took(client, flight):
    told = await answered(client.get(f"{flight}/analysis/dives"))
    dives = told["dives"]
    assert [one["number"] for one in dives] == [1, 2, 3]
    for one in dives:
        assert one["depth_m"] == pytest.approx(DEEP_M, abs=0.02)
        assert one["duration_s"] == pytest.approx(DIVE_S, abs=20.0)
        assert one["distance_m"] == pytest.approx(0.001 * one["duration_s"], abs=0.02)
        assert one["legs"] == 2
        assert one["samples"] == pytest.approx(DIVE_S / 5.0, abs=6)
        steps = one["energy_j"] / told["energy_step_j"]
        assert steps == pytest.approx(DIVE_S / 30.0, abs=1.5)
    capacity_wh = BATTERY_PRESETS.get("miniglider", BatteryConfig()).capacity_wh
    assert told["energy_step_j"] == pytest.approx(STEP_OF_CHARGE * capacity_wh * 3600, rel=0.01)


async def test_series_say_their_unit_and_their_name_in_the_file(client, flight):
    told = await answered(client.get(f"{flight}/analysis/dives"))
    by_key = {one["key"]: one for one in told["series"]}
    assert (by_key["temperature"]["variable"], by_key["temperature"]["kind"]) == ("TEMP", "sampled")
    assert (by_key["density"]["variable"], by_key["density"]["kind"]) == ("DENSITY", "derived")
    assert by_key["conservative_temperature"]["variable"] == ""
    assert (by_key["pitch_rad"]["unit"], by_key["pitch_rad"]["variable"]) == ("degree", "PITCH")
    assert by_key["depth"]["variable"] == "DEPTH"


async def test_rows_are_aligned_by_time_and_say_which_dive_they_are_of(client, flight):
    found = await rows_of(client, flight, channels="temperature,salinity", dives="2")
    assert set(found["dive"]) == {2}
    assert set(found["direction"]) == {1, -1}
    temperature, salinity = found["series"]
    assert salinity["interpolated"] + temperature["interpolated"] >= found["total"] - 1
    assert all(one == 35.0 for one in salinity["value"] if one is not None)
    depth = np.array(found["depth_m"])
    value = np.array(temperature["value"])
    is_water = value < 40.0
    assert value[is_water] == pytest.approx(20.0 - 10.0 * depth[is_water], abs=0.3)
    down = [one for one, way in zip(depth, found["direction"], strict=True) if way == 1]
    assert down == sorted(down)


async def test_thinned_rows_keep_extremes_and_statistics_are_of_all(client, flight):
    whole = await rows_of(client, flight, channels="temperature")
    thin = await rows_of(client, flight, channels="temperature", limit=20)
    assert not whole["decimated"]
    assert thin["decimated"]
    assert thin["total"] == whole["total"] == len(whole["time_s"])
    assert 20 <= len(thin["time_s"]) <= 24
    (some,), (every,) = thin["series"], whole["series"]
    assert max(some["value"]) == max(every["value"]) == 41.0
    assert some["statistics"] == every["statistics"]
    values = np.array(every["value"])
    said = every["statistics"]
    assert said["count"] == values.size == sum(every["bins"]["counts"])
    assert said["mean"] == pytest.approx(values.mean())
    assert said["std"] == pytest.approx(values.std(ddof=1))
    assert said["median"] == pytest.approx(np.median(values))
    assert said["low_5"] == pytest.approx(np.percentile(values, 5))
    assert (said["least"], said["greatest"]) == (values.min(), 41.0)


async def test_flags_are_those_of_the_newest_check_and_of_people(client, flight):
    before = await rows_of(client, flight, channels="temperature")
    assert not before["is_checked"]
    assert set(before["series"][0]["flag"]) == {0}
    await run(client, flight)
    (checked,) = (await rows_of(client, flight, channels="temperature"))["series"]
    assert checked["flag"][checked["value"].index(41.0)] == 4
    assert set(checked["flag"]) >= {1, 4}
    (kept,) = (await rows_of(client, flight, channels="temperature", flag_max=2))["series"]
    assert 41.0 not in kept["value"]
    assert kept["statistics"]["greatest"] <= 20.0
    begun = datetime.fromisoformat((await answered(client.get(flight)))["started_at"])
    said = {
        "series": "temperature",
        "first_at": begun.isoformat(),
        "last_at": (begun + timedelta(hours=1) - timedelta(minutes=10)).isoformat(),
        "flag": 3,
        "reason": "Mud",
    }
    await answered(client.post(f"{flight}/flags", json=said), 201)
    (mud,) = (await rows_of(client, flight, channels="temperature"))["series"]
    assert set(mud["flag"]) == {3}


async def test_density_is_told_for_a_ts_diagram(client, flight):
    keys = "absolute_salinity,conservative_temperature"
    found = await rows_of(client, flight, channels=keys)
    density = found["density"]
    shape = np.array(density["sigma0"]).shape
    assert shape == (len(density["temperature"]), len(density["salinity"]))
    salinity, conservative = (np.array(one["value"]) for one in found["series"])
    assert salinity == pytest.approx(35.17, abs=0.1)
    assert conservative[np.isfinite(conservative)].min() < 15.0
    assert density["salinity"][0] < salinity.min() <= salinity.max() < density["salinity"][-1]
    # colder water is denser
    assert np.diff(np.array(density["sigma0"]), axis=0).max() < 0.0
    assert (await rows_of(client, flight, channels="temperature"))["density"] is None


async def test_the_table_holds_all_rows_with_units_and_the_mark_of_the_simulator(client, flight):
    answer = await client.get(
        f"{flight}/analysis/rows.csv", params={"channels": "temperature", "dives": "1-2"}
    )
    assert answer.status_code == 200
    assert "SIMULATION" in answer.headers["content-disposition"]
    head, *lines = answer.text.splitlines()
    assert head == "# SIMULATION: this robot does not exist"
    rows = list(csv.DictReader(io.StringIO("\n".join(lines[1:]))))
    found = await rows_of(client, flight, channels="temperature", dives="1-2")
    assert len(rows) == found["total"]
    assert [float(row["temperature_degC"]) for row in rows] == found["series"][0]["value"]
    assert {row["dive"] for row in rows} == {"1", "2"}
    assert {row["direction"] for row in rows} == {"down", "up"}
    assert rows[0]["time_utc"].endswith("Z")


@pytest.mark.parametrize(
    ("query", "field", "words"),
    [
        ({"channels": "wind"}, "channels", "wind: must be of depth, salinity, temperature"),
        ({"channels": ","}, "channels", "must name a series"),
        ({"channels": "temperature", "dives": "1-x"}, "dives", "'1-x' is none"),
        ({"channels": "temperature", "dives": "3-1"}, "dives", "numbers of dives such as 1-5,9"),
        ({"channels": "temperature", "flag_max": 5}, "flag_max", "less than or equal to 4"),
        ({"channels": "temperature", "limit": 1}, "limit", "greater than or equal to 10"),
    ],
)
async def test_what_cannot_be_asked_is_named_with_its_limit(client, flight, query, field, words):
    refused = await answered(client.get(f"{flight}/analysis/rows", params=query), 422)
    (error,) = refused["errors"]
    assert error["loc"][-1] == field
    assert words in error["msg"]


async def test_too_many_series_are_refused(client, flight):
    keys = "depth,temperature,salinity,density,sound_speed,pitch_rad,roll_rad"
    refused = await answered(client.get(f"{flight}/analysis/rows", params={"channels": keys}), 422)
    assert refused["errors"][0]["msg"] == "at most 6 at once; are 7"


async def test_a_dive_that_there_is_not_has_no_rows(client, flight):
    found = await rows_of(client, flight, channels="temperature", dives=str(DIVES + 7))
    assert (found["total"], found["time_s"]) == (0, [])
    (series,) = found["series"]
    assert series["statistics"]["count"] == 0
    assert series["bins"] == {"edges": [], "counts": []}


async def test_a_large_deployment_is_read_in_a_worker_with_the_same_outcome(
    client, flight, monkeypatch
):
    here = await rows_of(client, flight, channels="temperature,density")
    dives = await answered(client.get(f"{flight}/analysis/dives"))
    monkeypatch.setattr(analyses, "HERE_MAX", 0)
    assert await rows_of(client, flight, channels="temperature,density") == here
    assert await answered(client.get(f"{flight}/analysis/dives")) == dives


def lines(answer):
    assert answer.headers["content-type"] == LINES
    return [json.loads(line) for line in answer.text.splitlines()]


@pytest.mark.parametrize("what", ["dives", "rows?channels=temperature"])
async def test_how_far_a_long_reading_is_stands_ahead_of_the_same_answer(
    client, flight, monkeypatch, what
):
    path, accept = f"{flight}/analysis/{what}", {"Accept": LINES}
    plain = await answered(client.get(path))
    assert lines(await client.get(path, headers=accept)) == [{"answer": plain}]
    monkeypatch.setattr(analyses, "HERE_MAX", 0)

    async def run_here(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        work = {answer.ROWS_TASK: answer.run_rows, answer.DIVES_TASK: answer.run_dives}[task]
        return await asyncio.to_thread(work, payload, told, lambda: False)

    def told(news):
        loop.call_soon_threadsafe(shares.append, news[0])

    loop, shares = asyncio.get_running_loop(), []
    monkeypatch.setattr("server.base.worker.WorkerPool.run", run_here)
    *_, last = lines(await client.get(path, headers=accept))
    assert last == {"answer": plain}
    assert shares == sorted(shares)
    assert 0.0 < shares[-1] <= 1.0

    async def say_and_break(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        on_progress((0.25, "Reading"))
        raise WorkerTaskError("the disk broke")

    monkeypatch.setattr("server.base.worker.WorkerPool.run", say_and_break)
    said = lines(await client.get(path, headers=accept))
    assert said[0] == {"progress": 0.25}
    assert said[1:] == [{"problem": "The rows could not be read; try again. the disk broke"}]


async def test_what_has_not_begun_has_no_dives_and_who_may_not_look_sees_none(client, station):
    planned = await answered(client.post("/api/deployments", json={"robot": MINI}), 201)
    path = f"/api/deployments/{planned['id']}/analysis"
    await answered(client.get(f"{path}/dives"), 409)
    await answered(client.get("/api/deployments/deployment-99/analysis/dives"), 404)
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get(f"{path}/dives")).status_code == 409
