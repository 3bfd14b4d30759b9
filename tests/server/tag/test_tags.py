"""Tags over REST: heard live, imported, listed, exported, and found where they rest."""

import csv
import io
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from autonomy.frames import wgs84_from_ned
from autonomy.site import LAKE
from db.ingest import append_telemetry
from robot_link.messages import LogId
from robot_link.report import Detection, ReceiverReport
from server.tag.vue import COLUMNS
from tests.server.conftest import GRACE, until
from tests.server.fake_link import state_report

BEGAN = datetime(2026, 7, 1, 9, 0, tzinfo=UTC)
PERCH, PIKE = "A69-1601-179", "A69-9002-4711"
HEAD = ",".join(COLUMNS)


def heard_tag(minute, tag=PERCH, place=(100.0, 120.0, 3.0), **changes):
    at = BEGAN + timedelta(minutes=minute)
    return replace(
        Detection(GRACE, LogId(1), minute, 480123, tag, None, place, 2.0, at, at), **changes
    )


async def keep(foundation, values):
    await foundation.store.write(lambda session: append_telemetry(session, values))


async def import_file(client, text):
    files = {"file": ("vue.csv", io.BytesIO(text.encode()))}
    answer = await client.post(f"/api/robots/{GRACE}/detections", files=files)
    assert answer.status_code == 202, answer.text

    async def ended():
        job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
        return job if job["state"] not in {"queued", "running"} else None

    return await until(ended)


def vue(rows):
    return "\n".join([HEAD, *(",".join(map(str, row)) for row in rows)]) + "\n"


def vue_row(second, tag=PERCH, latitude="", longitude=""):
    at = BEGAN + timedelta(seconds=second)
    return (f"{at:%Y-%m-%d %H:%M:%S}", "VR2W-1", tag, "", "", "", "", "", latitude, longitude)


async def test_detections_are_listed_newest_first_with_their_doubt(foundation, client):
    await keep(foundation, [heard_tag(0), heard_tag(10), heard_tag(400), heard_tag(5, PIKE)])
    found = (await client.get(f"/api/robots/{GRACE}/detections")).json()
    assert [(one["tag"], one["doubtful"]) for one in found["detections"]] == [
        (PERCH, True),
        (PERCH, False),
        (PIKE, True),
        (PERCH, False),
    ]
    assert found["detections"][0]["receiver"] == "VR2C-480123"
    sure = (await client.get(f"/api/robots/{GRACE}/detections?doubtful=false&limit=1")).json()
    assert (sure["total"], len(sure["detections"])) == (2, 1)
    assert sure["detections"][0]["measured_at"].startswith("2026-07-01T09:10")


async def test_doubt_looks_beyond_what_is_asked_for(foundation, client):
    await keep(foundation, [heard_tag(0), heard_tag(50)])
    since = (BEGAN + timedelta(minutes=40)).isoformat().replace("+00:00", "Z")
    found = (await client.get(f"/api/robots/{GRACE}/detections?since={since}")).json()
    assert [one["doubtful"] for one in found["detections"]] == [False]


async def test_tags_are_told_with_their_times_and_the_receiver(foundation, client):
    report = ReceiverReport(GRACE, BEGAN, BEGAN, 480123, 3, 2, 1, 0, -75.0)
    await keep(foundation, [heard_tag(0), heard_tag(30), heard_tag(5, PIKE), report])
    told = (await client.get(f"/api/robots/{GRACE}/tags")).json()
    perch, pike = told["tags"]
    assert (perch["tag"], perch["hours"], perch["doubts"]) == (PERCH, [0.0, 0.5], [False, False])
    assert (pike["detections"], pike["doubtful"]) == (1, 1)
    receiver = told["receiver"]
    assert (receiver["refused_sum"], receiver["refused_date"], receiver["is_clock_off"]) == (
        2,
        1,
        True,
    )


async def test_settings_change_what_is_doubtful(foundation, client):
    await keep(foundation, [heard_tag(0), heard_tag(50)])
    current = await client.get(f"/api/config/tags?robot={GRACE}")
    changed = await client.patch(
        f"/api/config/tags?robot={GRACE}",
        json={"doubtful_after_s": 600.0},
        headers={"If-Match": current.headers["etag"]},
    )
    assert changed.status_code == 200, changed.text
    told = (await client.get(f"/api/robots/{GRACE}/tags")).json()
    assert told["doubtful"] == 2


async def test_an_import_places_and_keeps_every_row_once(foundation, client):
    place = wgs84_from_ned((200.0, 50.0), LAKE.origin_latitude_deg, LAKE.origin_longitude_deg)
    await keep(
        foundation,
        [
            replace(
                state_report(GRACE, (10.0 * n, 5.0, 1.0)), measured_at=BEGAN + timedelta(minutes=n)
            )
            for n in range(3)
        ],
    )
    text = vue([vue_row(0, PERCH, *place.tolist()), vue_row(60), vue_row(9000)])
    job = await import_file(client, text)
    assert job["state"] == "done", job
    assert job["result"] == {
        "robot": GRACE,
        "detections": 3,
        "known": 0,
        "without_place": 1,
    }
    again = await import_file(client, text)
    assert (again["result"]["detections"], again["result"]["known"]) == (0, 3)
    rows = (await client.get(f"/api/robots/{GRACE}/detections")).json()["detections"]
    assert [(one["north_m"], one["east_m"]) for one in rows[1:2]] == [(10.0, 5.0)]
    assert rows[0]["north_m"] is None
    assert abs(rows[2]["north_m"] - 200.0) < 0.01


async def test_a_broken_file_is_refused_by_line_and_leaves_nothing(client):
    job = await import_file(client, vue([vue_row(0), vue_row(1, "fish")]))
    assert job["state"] == "failed"
    assert job["result"]["errors"][0]["line"] == 3
    far = await import_file(client, vue([vue_row(0), vue_row(1, PERCH, -33.0, 151.0)]))
    assert far["result"]["errors"][0]["line"] == 3
    assert "km from" in far["result"]["errors"][0]["reason"]
    assert (await client.get(f"/api/robots/{GRACE}/detections")).json()["total"] == 0


async def test_many_detections_come_in_blocks_and_whole(client):
    rows = [vue_row(7 * n, f"A69-1601-{1 + n % 40}") for n in range(12_001)]
    job = await import_file(client, vue(rows))
    assert job["result"]["detections"] == 12_001
    told = (await client.get(f"/api/robots/{GRACE}/tags")).json()
    assert (told["detections"], len(told["tags"]), told["doubtful"]) == (12_001, 40, 0)


async def test_an_export_has_the_columns_of_vue_and_what_the_map_says(
    station, foundation, world, client
):
    robot = world.robots[GRACE]
    for n in range(30):
        robot.sample((60.0 + 4.0 * n, 120.0, 3.0), "chlorophyll")
    await keep(foundation, [heard_tag(0), heard_tag(10)])

    async def mapped():
        answer = await client.get(f"/api/robots/{GRACE}/detections.csv")
        rows = list(csv.DictReader(io.StringIO(answer.text)))
        return rows if any("mean" in name and rows[0][name] for name in rows[0]) else None

    rows = await until(mapped)
    assert list(rows[0])[:10] == list(COLUMNS)
    assert (rows[0]["Transmitter"], rows[0]["Doubtful"]) == (PERCH, "no")
    mean, std = (
        float(next(rows[0][name] for name in rows[0] if f" {what} [" in name))
        for what in ("mean", "std")
    )
    assert mean > 0.0
    assert std > 0.0
    latitude = float(rows[0]["Latitude"])
    assert abs(latitude - LAKE.origin_latitude_deg) < 0.01


async def test_a_resting_tag_is_told_with_its_regions(foundation, client):
    rng = np.random.default_rng(4)
    states, heard = [], []
    for minute in range(200):
        place = (40.0 + 1.7 * minute, 150.0 + 60.0 * np.sin(minute / 20.0), 2.0)
        at = BEGAN + timedelta(minutes=minute)
        states.append(replace(state_report(GRACE, place), measured_at=at, received_at=at))
        if np.hypot(place[0] - 200.0, place[1] - 200.0) < 90.0 and rng.random() < 0.5:
            heard.append(heard_tag(minute, PERCH, place))
    await keep(foundation, states + heard)
    told = (await client.get(f"/api/robots/{GRACE}/tags/{PERCH}/resting")).json()
    assert told["text"].startswith("If it stays where it is")
    assert 0.0 < told["half_ha"] < told["most_ha"]
    assert sum(run["count"] for run in told["half"]) < sum(run["count"] for run in told["most"])
    assert told["detections"] == len(heard)
    track = (await client.get(f"/api/robots/{GRACE}/tags/track")).json()
    rates = [point["per_hour"] for point in track["points"]]
    assert max(rates) > 10.0
    assert rates[0] < max(rates)


async def test_a_tag_that_was_never_heard_is_not_found(client):
    answer = await client.get(f"/api/robots/{GRACE}/tags/{PERCH}/resting")
    assert answer.status_code == 404
    assert "beyond doubt" in answer.json()["detail"]
