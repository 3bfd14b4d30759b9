"""Designs from plan files and as such files, by REST."""

import json

import numpy as np
import pytest

from tests.server.conftest import GRACE

FORMATS = ("qgc_plan", "wpl", "kml", "geojson", "csv")


async def begun(client, places, **manner):
    waypoints = [{"north_m": north, "east_m": east} for north, east in places]
    document = {"content": {"kind": "waypoints", "waypoints": waypoints}, "manner": manner}
    body = {"name": "Line of the lake", "document": document}
    return (await client.post(f"/api/robots/{GRACE}/designs", json=body)).json()


async def read(client, name, content, **choices):
    return await client.post(
        f"/api/robots/{GRACE}/designs/read",
        files={"file": (name, content)},
        data={"choices": json.dumps(choices)},
    )


@pytest.mark.parametrize("format", FORMATS)
async def test_what_is_written_is_read_again_to_a_millimetre(client, format):
    places = np.random.default_rng().uniform(170.0, 330.0, (6, 2)).round(3)
    design = await begun(client, places.tolist(), deep_m=9.0)
    path = f"/api/designs/{design['id']}/file"
    written = await client.get(path, params={"format": format})
    assert written.status_code == 200, written.text
    assert "Line_of_the_lake" in written.headers["Content-Disposition"]
    name = written.headers["Content-Disposition"].split('"')[1]
    answer = await read(client, name, written.content)
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert found["is_ready"]
    assert found["refused"] == []
    back = [(one["north_m"], one["east_m"]) for one in found["document"]["content"]["waypoints"]]
    # seven decimals of a degree, as the formats hold them, are a centimetre
    digits_m = 0.001 if format in ("qgc_plan", "csv", "kml", "wpl") else 0.012
    np.testing.assert_allclose(back, places, atol=digits_m)


async def test_what_other_programs_will_not_see_is_told_before_it_is_saved(client):
    places = [(200.0, 200.0), (300.0, 200.0)]
    design = await begun(client, places, deep_m=9.0, shallow_m=1.0)
    path = f"/api/designs/{design['id']}/file/losses"
    lost = (await client.get(path, params={"format": "wpl"})).json()
    kept = (await client.get(path, params={"format": "qgc_plan"})).json()
    assert lost
    assert not any(one["is_kept"] for one in lost)
    assert all(one["is_kept"] for one in kept)


async def test_altitudes_above_the_water_are_refused_until_somebody_says_that_they_are_depths(
    client,
):
    plan = "QGC WPL 110\n" + "\n".join(
        f"{number}\t0\t{frame}\t16\t0\t0\t0\t0\t{latitude}\t{longitude}\t{z}\t1"
        for number, frame, latitude, longitude, z in (
            (0, 0, 42.732, -84.482, 0.0),
            (1, 3, 42.7325, -84.4815, 8.0),
            (2, 3, 42.7330, -84.4815, 8.0),
        )
    )
    refused = (await read(client, "a.waypoints", plan.encode(), is_moved=True)).json()
    assert len(refused["refused"]) == 2
    assert any(one["key"] == "turns_sign" for one in refused["needs"])
    taken = (
        await read(client, "a.waypoints", plan.encode(), is_moved=True, turns_sign=True)
    ).json()
    assert taken["refused"] == []
    assert len(taken["document"]["content"]["waypoints"]) == 2


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.plan", b""),
        ("a.plan", b"{"),
        ("a.kmz", b"PK\x03\x04 and nothing"),
        ("a.kml", b'text <?xml version="1.0"?><kml/>'),
        ("a.xyz", b"1 2 3"),
    ],
)
async def test_a_file_that_is_none_is_refused_with_its_place(client, name, content):
    answer = await read(client, name, content)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"][0] == "file"
    assert answer.json()["errors"][0]["msg"]


async def test_choices_that_are_none_are_refused_by_their_field(client):
    path = f"/api/robots/{GRACE}/designs/read"
    files = {"file": ("a.plan", b"{}")}
    wrong = await client.post(path, files=files, data={"choices": '{"turn": 1}'})
    assert wrong.json()["errors"][0]["loc"] == ["choices", "turn"]
    broken = await client.post(path, files=files, data={"choices": "{"})
    assert broken.json()["errors"] == [{"loc": ["choices"], "msg": "it is no JSON"}]
