"""Recordings of other makers leave the station as files in which no checker finds anything."""

import pytest

from tests.server.delivery.test_file_api import METADATA, write
from tests.server.deployment.shore import answered
from tests.server.recording.test_foreign import counts, ended
from tests.server.recording_file.test_figures import public

KINDS = {
    "a glider's table": ("../eva035_chl_temp.csv", 5044),
    "a dive of a Seaglider": ("p5420304.nc", 1101),
    "a file of OG1.0": ("sp028_20230202T1637_R.nc", 372),
}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", KINDS)
async def test_the_fields_checkers_find_nothing_in_what_was_imported(station, client, kind):
    pytest.importorskip("compliance_checker", reason="compliance-checker is not installed")
    name, rows = KINDS[kind]
    (path,) = public(name)
    part = ("files", (path.name, path.read_bytes()))
    answer = await client.post("/api/imports/uploads", files=[part])
    proposal = (await ended(client, answer))["result"]
    mapping = proposal["mapping"] | {"is_utc": True}
    body = {"robot": "other", "mapping": mapping, "policy": "skip"}
    answer = await client.post(f"/api/imports/uploads/{proposal['upload']}", json=body)
    job = await ended(client, answer)
    assert job["state"] == "done", job["message"]
    assert counts(job["result"])[0] == rows
    deployment = f"/api/deployments/{job['result']['deployment']}"
    await answered(client.patch("/api/config/delivery?robot=other", json=METADATA))
    told = await write(client, deployment)
    assert told["state"] == "done", told["message"]
    (file,) = (await answered(client.get(f"{deployment}/files")))["files"]
    said = {one["suite"]: (one["state"], one["findings"]) for one in file["checks"]}
    assert said == dict.fromkeys(("own", "og:1.0", "cf:1.10"), ("passed", []))
