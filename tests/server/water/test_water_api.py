"""Waters by REST: listed, added by hand and from files, changed, retired, given to robots."""

import asyncio

import numpy as np
import pytest

from autonomy.site import LAKE, Box, Site
from server.fleet.fleet import Fleet
from server.water.waters import Waters
from tests.server.conftest import until
from tests.server.water.foreign import CENTRE, bay, bowl, feature, geojson, geotiff, square

pytestmark = pytest.mark.usefixtures("in_threads")


async def read(client, name, content, **form):
    """Import a file and return its job when that has ended."""
    answer = await client.post("/api/waters/imports", data=form, files={"file": (name, content)})
    assert answer.status_code == 202, answer.text
    async with asyncio.timeout(120):
        while True:
            job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
            if job["state"] not in {"queued", "running"}:
                return job
            await asyncio.sleep(0.02)


async def proposal(client, name, content, **form):
    job = await read(client, name, content, **form)
    assert job["state"] == "done", job["message"]
    return job["result"]


BAY = geojson(
    feature("Polygon", [bay(), square(0.02, 0.02)[::-1]], name="Bay"),
    feature("Polygon", [square(-0.02, 0.0)], name="Harbour entry"),
    feature("Point", [CENTRE[1] + 0.01, CENTRE[0]], name="North dock", kind="dock"),
)


async def test_delivered_waters_are_rows_like_others(client):
    found = {water["id"]: water for water in (await client.get("/api/waters")).json()}
    assert found["test-tank"]["robots"] == ["mini-1"]
    assert found["practice-lake"]["robots"] == ["grace-1"]
    one = await client.get("/api/waters/practice-lake")
    assert one.headers["ETag"] == '"1"'
    assert Site.model_validate(one.json()["document"]) == LAKE
    assert (await client.get("/api/waters/nowhere")).status_code == 404


async def test_a_water_is_made_of_two_files_and_given_to_a_robot(client, station, tmp_path):
    shapes = await proposal(client, "bay.geojson", BAY)
    assert [f["role"] for f in shapes["features"]] == ["outline", "keep_out", "place"]
    assert shapes["features"][0]["holes"] == 1
    geotiff(tmp_path / "depths.tif", bowl())
    depths = await proposal(client, "depths.tif", (tmp_path / "depths.tif").read_bytes())
    assert depths["depths"]["are_heights"]
    assert 0.0 < depths["depths"]["land_share"] < 0.5
    assert any("negative heights" in text for text in depths["warnings"])
    body = {
        "name": "Our bay",
        "depth_datum": "mean low water",
        "proposals": [{"proposal": one["proposal"]} for one in (shapes, depths)],
    }
    added = await client.post("/api/waters", json=body)
    assert added.status_code == 201, added.text
    water = added.json()
    assert (water["id"], water["version"], water["robots"]) == ("our-bay", 1, [])
    site = Site.model_validate(water["document"])
    assert site.clearance_m(0.0, 0.0) > 1000.0
    assert [area.name for area in site.keep_outs] == ["Harbour entry"]
    [place] = site.places
    assert (place.kind, place.longitude_deg) == ("dock", pytest.approx(CENTRE[1] + 0.01))
    assert place.east_m == pytest.approx(802.0, abs=5.0)
    assert float(site.floor_m(0.0, 0.0)) == pytest.approx(30.0, abs=0.2)
    island = site.islands[0].outline
    assert island.contains(*np.mean(island.rings[0], axis=0))
    # other people's tools read it back
    outline = (await client.get("/api/waters/our-bay/outline")).json()
    assert [f["properties"]["role"] for f in outline["features"]] == ["outline", "keep_out", "dock"]
    assert outline["features"][0]["geometry"]["coordinates"][0][0] == pytest.approx(bay()[0], 1e-6)
    shown = (await client.get("/api/waters/our-bay/depths", params={"lines": 20})).json()
    assert max(map(max, shown["depth_m"])) > 25.0
    moved = await client.patch("/api/robots/grace-1", json={"water": "our-bay"})
    assert moved.status_code == 200, moved.text
    assert (moved.json()["water"], moved.json()["site"]["name"]) == ("our-bay", "Our bay")
    assert (await client.get("/api/waters/our-bay")).json()["robots"] == ["grace-1"]


async def test_a_changed_water_reaches_its_robots_and_stale_changes_are_refused(client, station):
    url = "/api/waters/practice-lake"
    etag = (await client.get(url)).headers["ETag"]
    changes = {"tide_offset_m": 0.5, "depth_datum": "chart datum"}
    changed = await client.patch(url, json=changes, headers={"If-Match": etag})
    assert changed.status_code == 200, changed.text
    assert changed.headers["ETag"] == '"2"'
    stale = await client.patch(url, json={"name": "Pond"}, headers={"If-Match": etag})
    assert stale.status_code == 412

    fleet = station.foundation.services.get(Fleet)
    await until(lambda: fleet.status("grace-1").record.site.tide_offset_m == 0.5)
    shown = (await client.get("/api/robots/grace-1")).json()["site"]
    document = Site.model_validate(shown)
    assert float(document.floor_m(100.0, 100.0)) == float(LAKE.floor_m(100.0, 100.0)) + 0.5


async def test_a_changed_water_reaches_who_was_put_there_while_it_was_made(
    client, station, monkeypatch
):
    real = Waters._with_proposals

    async def slow(waters, site, wanted, *, is_new):
        put = await client.patch("/api/robots/mini-1", json={"water": "practice-lake"})
        assert put.status_code == 200, put.text
        return await real(waters, site, wanted, is_new=is_new)

    monkeypatch.setattr(Waters, "_with_proposals", slow)
    url = "/api/waters/practice-lake"
    changed = await client.patch(url, json={"tide_offset_m": 0.5})
    assert changed.status_code == 200, changed.text
    assert changed.json()["robots"] == ["mini-1", "grace-1"]
    fleet = station.foundation.services.get(Fleet)
    await until(lambda: fleet.status("mini-1").record.site.tide_offset_m == 0.5)


async def test_a_water_with_robots_is_not_retired_and_a_retired_one_takes_none(client):
    refused = await client.patch("/api/waters/test-tank", json={"is_retired": True})
    assert refused.status_code == 409
    assert "mini-1" in refused.json()["detail"]
    site = LAKE.model_copy(update={"name": "Other lake"}).model_dump(mode="json")
    assert (await client.post("/api/waters", json={"document": site})).status_code == 201
    again = await client.post("/api/waters", json={"document": site, "id": "other-lake"})
    assert again.status_code == 409
    gone = await client.patch("/api/waters/other-lake", json={"is_retired": True})
    assert gone.json()["is_retired"]
    put = await client.patch("/api/robots/grace-1", json={"water": "other-lake"})
    assert put.status_code == 409
    back = await client.patch("/api/waters/other-lake", json={"is_retired": False})
    assert not back.json()["is_retired"]
    put = await client.patch("/api/robots/grace-1", json={"water": "other-lake"})
    assert put.status_code == 200


async def test_scripts_still_give_a_robot_a_site_of_its_own(client):
    site = LAKE.model_copy(update={"name": "Script's lake"}).model_dump(mode="json")
    own = await client.patch("/api/robots/grace-1", json={"site": site})
    assert (own.json()["water"], own.json()["site"]["name"]) == (None, "Script's lake")
    lake = await client.patch("/api/robots/grace-1", json={"site": LAKE.model_dump(mode="json")})
    assert lake.json()["water"] == "practice-lake"
    both = await client.patch("/api/robots/grace-1", json={"site": site, "water": "test-tank"})
    assert both.status_code == 422
    unknown = await client.patch("/api/robots/grace-1", json={"water": "nowhere"})
    assert unknown.status_code == 422


async def test_a_refused_file_names_the_feature_and_leaves_nothing(client, station):
    bad = geojson(feature("Point", [0.0, 0.0]), feature("Polygon", [[[0, 0], [1, 1], [0, 1]]][:0]))
    job = await read(client, "bad.geojson", bad)
    assert job["state"] == "failed"
    assert job["result"]["errors"][0]["place"] == "feature 2"
    folder = station.foundation.settings.data_dir / "water_proposals"
    assert not folder.exists() or not list(folder.iterdir())
    made = {"name": "X", "proposals": [{"proposal": "0123456789abcdef"}], "depth_max_m": 5.0}
    answer = await client.post("/api/waters", json=made)
    assert answer.status_code == 422
    assert "import the file again" in answer.json()["errors"][0]["msg"]
    empty = await client.post("/api/waters", json={"name": "X"})
    assert empty.status_code == 422


async def test_an_outline_alone_needs_to_be_told_how_deep_the_water_is(client):
    shapes = await proposal(client, "bay.json", BAY, format="geojson")
    confirmed = [{"proposal": shapes["proposal"], "roles": {"2": "ignored"}}]
    shallow = await client.post("/api/waters", json={"name": "Bay", "proposals": confirmed})
    assert shallow.status_code == 422
    assert shallow.json()["errors"][0]["loc"] == ["depth_max_m"]
    told = {"name": "Bay", "proposals": confirmed, "depth_max_m": 12.0}
    made = await client.post("/api/waters", json=told)
    assert made.status_code == 201, made.text
    assert made.json()["document"]["water"]["depth_max_m"] == 12.0
    assert made.json()["document"]["keep_outs"] == []
    wrong = {**told, "proposals": [{"proposal": shapes["proposal"], "roles": {"3": "outline"}}]}
    refused = await client.post("/api/waters", json=wrong)
    assert refused.json()["errors"][0]["loc"] == ["feature 3"]


async def test_a_long_outline_and_a_large_grid_are_kept_as_a_chart(client, station, tmp_path):
    long = geojson(feature("Polygon", [bay(5000, wobble=0.05)], name="Long"))
    shapes = await proposal(client, "long.geojson", long)
    geotiff(tmp_path / "fine.tif", bowl(400, 500), step=0.0005)
    depths = await proposal(client, "fine.tif", (tmp_path / "fine.tif").read_bytes())
    body = {
        "name": "Long bay",
        "proposals": [{"proposal": one["proposal"]} for one in (shapes, depths)],
    }
    made = await client.post("/api/waters", json=body)
    assert made.status_code == 201, made.text
    assert len(made.content) < 20_000
    site = Site.model_validate(made.json()["document"])
    chart = site.chart
    assert chart is not None
    assert (chart.corners, chart.islands) == (5000, 0)
    assert chart.rows > 200
    assert site.shore is not None
    assert len(site.shore.begins) == 5000
    # the document alone leaves the chart's water nowhere, nor is it deeper
    short = site.model_copy(update={"chart": None})
    generator = np.random.default_rng()
    north, east = generator.uniform(-7000.0, 7000.0, (2, 4000))
    assert short.shore is not None
    is_inside = short.shore.contains(north, east)
    assert site.shore.contains(north, east)[is_inside].all()
    assert is_inside.sum() > 0.8 * site.shore.contains(north, east).sum()
    assert (short.floor_m(north, east) <= site.floor_m(north, east) + 1e-6).all()
    # what a robot takes with it fits its domain more closely, and leaves the water nowhere either
    near = {"x_min_m": 3500.0, "x_max_m": 5200.0, "y_min_m": -900.0, "y_max_m": 900.0}
    moved = site.model_copy(update={"domain": Box(**near, depth_max_m=20.0)})
    body = {"document": moved.model_dump(mode="json")}
    assert (await client.patch("/api/waters/long-bay", json=body)).status_code == 200
    taken = await client.get("/api/waters/long-bay/on-board")
    assert taken.status_code == 200, taken.text
    aboard = Site.model_validate(taken.json())
    assert aboard.chart is None
    assert aboard.shore is not None
    north, east = generator.uniform([[3500.0], [-900.0]], [[5200.0], [900.0]], (2, 4000))
    is_inside = aboard.shore.contains(north, east)
    is_true = site.shore.contains(north, east)
    assert is_true[is_inside].all()
    assert is_inside.sum() > 0.9 * is_true.sum()
    assert is_inside.sum() >= short.shore.contains(north, east).sum()
    assert (aboard.floor_m(north, east) <= site.floor_m(north, east) + 1e-6)[is_inside].all()
    again = await client.patch("/api/waters/long-bay", json={"tide_offset_m": 1.0})
    assert again.json()["document"]["chart"] == made.json()["document"]["chart"]


async def test_reading_can_be_cancelled(client, station, monkeypatch):
    begun = asyncio.Event()

    async def never(*_, **__):
        begun.set()
        await asyncio.Event().wait()

    monkeypatch.setattr(type(station.foundation.workers), "run", never)
    files = {"file": ("bay.geojson", BAY)}
    answer = await client.post("/api/waters/imports", files=files)
    await begun.wait()
    job = await client.delete(f"/api/jobs/{answer.json()['id']}")
    assert job.json()["state"] == "cancelled", job.text
    await until(lambda: not station.foundation.jobs.running)
