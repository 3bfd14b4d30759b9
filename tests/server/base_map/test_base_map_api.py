"""Base maps by REST and by the command line."""

import os

from server.access.role import Role
from server.base_map.base_maps import FOLDER
from server.cli.main import main
from tests.server.base_map.tile_files import X, Y, Z, mbtiles, pmtiles, png
from tests.server.conftest import api_client


async def added(client, data=None, name="My Chart (2026).pmtiles"):
    return await client.post("/api/base-maps", files={"file": (name, data or pmtiles())})


async def test_a_map_is_added_listed_drawn_and_removed(client):
    answer = await added(client)
    assert answer.status_code == 201, answer.text
    told = answer.json()
    assert (told["id"], told["title"]) == ("my-chart-2026", "Lakes of Michigan")
    assert told["bytes"] == len(pmtiles())
    listed = (await client.get("/api/base-maps")).json()
    assert listed == {"base_maps": [told], "refused": []}
    tile = await client.get(f"/api/base-maps/my-chart-2026/tiles/{Z}/{X}/{Y}")
    assert tile.content == png()
    assert tile.headers["content-type"] == "image/png"
    assert tile.headers["x-content-type-options"] == "nosniff"
    assert tile.headers["content-security-policy"] == "default-src 'none'; sandbox"
    assert (await client.get(f"/api/base-maps/my-chart-2026/tiles/{Z}/0/0")).status_code == 204
    assert (await client.get("/api/base-maps/my-chart-2026/tiles/2/4/0")).status_code == 404
    assert (await client.delete("/api/base-maps/my-chart-2026")).status_code == 204
    assert (await client.get("/api/base-maps")).json()["base_maps"] == []
    gone = await client.get(f"/api/base-maps/my-chart-2026/tiles/{Z}/{X}/{Y}")
    assert gone.status_code == 404
    events = (await client.get("/api/events")).json()["events"]
    kinds = [event["kind"] for event in events if event["kind"].startswith("base-map")]
    assert sorted(kinds) == ["base-map.added", "base-map.removed"]


async def test_what_is_no_map_is_refused_and_leaves_nothing_behind(client, tmp_path):
    for data, name in ((b"<svg onload=alert(1)>", "a.pmtiles"), (pmtiles(), "‽.pmtiles")):
        refused = await added(client, data, name)
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["loc"] == ["file"]
    assert list((tmp_path / FOLDER).glob("*")) == []


async def test_an_id_is_taken_once_whatever_the_kind_of_file(client, tmp_path):
    assert (await added(client, name="a.pmtiles")).status_code == 201
    other = mbtiles(tmp_path / "other.mbtiles").read_bytes()
    assert (await added(client, other, "../../A.mbtiles")).status_code == 409
    assert [one.name for one in (tmp_path / FOLDER).iterdir()] == ["a.pmtiles"]


async def test_only_a_pilot_adds_and_removes(station):
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await added(viewer)).status_code == 403
        assert (await viewer.delete("/api/base-maps/a")).status_code == 403
        assert (await viewer.get("/api/base-maps")).status_code == 200


async def test_the_folder_is_the_truth_and_bad_files_are_named(client, tmp_path):
    folder = tmp_path / FOLDER
    folder.mkdir()
    (folder / "bad.mbtiles").write_bytes(b"nothing")
    (folder / "notes.txt").write_bytes(b"nothing")
    mbtiles(folder / "Harbour.mbtiles")
    listed = (await client.get("/api/base-maps")).json()
    assert [one["id"] for one in listed["base_maps"]] == ["harbour"]
    assert listed["refused"] == [
        {"file": "bad.mbtiles", "reason": "it is neither PMTiles nor MBTiles"}
    ]
    first = listed["base_maps"][0]["revision"]
    chart = folder / "Harbour.mbtiles"
    written_ns = chart.stat().st_mtime_ns
    chart.unlink()
    mbtiles(chart, {(Z, X, Y): png(grey=7)}, None)
    os.utime(chart, ns=(written_ns, written_ns + 10**9))  # the times of files tick in steps
    listed = (await client.get("/api/base-maps")).json()
    assert listed["base_maps"][0]["revision"] != first
    tile = await client.get(f"/api/base-maps/harbour/tiles/{Z}/{X}/{Y}")
    assert tile.content == png(grey=7)


async def test_a_tile_with_script_is_never_served(client):
    html = b"<!doctype html><script>alert(1)</script>"
    assert (await added(client, pmtiles({(0, 0, 0): png(), (Z, X, Y): html}))).status_code == 201
    refused = await client.get(f"/api/base-maps/my-chart-2026/tiles/{Z}/{X}/{Y}")
    assert refused.status_code == 422
    assert refused.headers["content-type"] == "application/problem+json"
    assert "SVG or HTML" in refused.json()["detail"]
    assert b"alert" not in refused.content


def test_the_command_line_adds_lists_and_removes(tmp_path, capsys):
    file = tmp_path / "bay.pmtiles"
    file.write_bytes(pmtiles())
    data = ["--data", str(tmp_path)]
    assert main(["base-map", "add", str(file), *data]) == 0
    assert capsys.readouterr().out.startswith("bay  0.0 MB  zoom 9 to 9  42.6000 to 42.9000 N")
    assert main(["base-map", "add", str(file), *data]) == 1
    assert "remove it first" in capsys.readouterr().err
    assert main(["base-map", "list", *data]) == 0
    assert "Lakes of Michigan" in capsys.readouterr().out
    assert main(["base-map", "remove", "bay", *data]) == 0
    assert main(["base-map", "remove", "bay", *data]) == 1
    assert not list((tmp_path / FOLDER).iterdir())
    file.write_bytes(b"nothing")
    assert main(["base-map", "add", str(file), *data]) == 1
    assert "neither PMTiles nor MBTiles" in capsys.readouterr().err
    assert main(["base-map", "add", str(tmp_path / "none"), *data]) == 1
