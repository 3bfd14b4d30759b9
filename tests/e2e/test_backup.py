"""A station that flies is backed up, destroyed, and restored: nothing that it took is lost."""

import os
import shutil
import signal
import subprocess
import sys

import httpx
import pytest

from tests.e2e.demo import ROOT, Demo, fly_dives

pytestmark = [pytest.mark.walk, pytest.mark.timeout(1800)]
PASSWORD = "correct horse battery"
SAMPLES = 20


def grace(*words, said="", status=0):
    done = subprocess.run(
        [sys.executable, "-m", "server.cli", *map(str, words)],
        cwd=ROOT, input=said, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout


def samples(demo):
    """What is kept of a channel: each value with its moment."""
    history = demo.get("/api/robots/mini-1/samples", channel="blue_light", max_points="20000")
    return set(zip(history["measured_at"], history["value"], strict=True))


def is_live(demo):
    robots = {robot["id"]: robot["link"]["state"] for robot in demo.get("/api/robots")}
    return robots["mini-1"] == "live"


def back_up(demo, folder, public_key):
    settings = {"folder": str(folder), "public_key": public_key}
    demo.client.put("/api/backups/settings", json=settings).raise_for_status()
    job = demo.post("/api/backups")["id"]

    def ended():
        told = demo.get(f"/api/jobs/{job}")
        return told if told["state"] not in ("queued", "running") else None

    told = demo.wait("the backup", ended, 60.0)
    assert told["state"] == "done", told["message"]
    return folder / told["result"]["file"]


def destroy(demo):
    """Kill the demo as a power cut would, and lose its disk."""
    group = os.getpgid(demo.children()["serve"])
    os.killpg(group, signal.SIGKILL)
    demo.stop()
    shutil.rmtree(demo.data)


def name_signed_in(demo, name):
    """Sign in by a password, and return as whom the station knows the browser then."""
    with httpx.Client(base_url=demo.url, timeout=60.0) as client:
        answer = client.post("/api/session", json={"name": name, "password": PASSWORD})
        assert answer.status_code == 200, answer.text
        return client.get("/api/session").json()["name"]


def secrets_of(data):
    """Return the secrets that stand still; stamps of signed frames grow with every frame."""
    files = [file for file in (data / "secret").iterdir() if not file.name.startswith("stamps-")]
    return {file.name: file.read_text() for file in files}


def test_a_flying_station_that_is_destroyed_comes_back_with_all_that_it_acknowledged(tmp_path):
    data, disk, key = tmp_path / "data", tmp_path / "disk", tmp_path / "lake.key"
    disk.mkdir()
    public_key = grace("db", "backup-key", key).split()[0]
    with Demo(data, "--speed", "20") as demo:
        demo.sign_in()
        grace("user", "add", "ann", "--role", "pilot", "--data", data, said=f"{PASSWORD}\n")
        token = grace("token", "create", "--role", "viewer", "--data", data).split()[-1]
        demo.wait("a robot", lambda: is_live(demo), 60.0)
        plan = fly_dives(demo, 8, 0.5)
        demo.wait("samples", lambda: len(samples(demo)) >= SAMPLES, 120.0)
        acknowledged = samples(demo)
        last_event = demo.get("/api/events", limit="1")["events"][-1]
        legs = demo.get(f"/api/plans/{plan}")["legs"]
        secrets = secrets_of(data)
        file = back_up(demo, disk, public_key)
        demo.wait("more samples", lambda: len(samples(demo)) > len(acknowledged), 120.0)
        destroy(demo)

    assert not data.exists()
    assert "is encrypted for the key" in refused(file, data)
    grace("db", "restore", file, "--key", key, "--data", data)
    assert "is whole" in grace("db", "check", "--data", data)
    assert "events fit" in grace("audit", "verify", "--data", data)
    assert secrets.items() <= secrets_of(data).items()

    with Demo(data, "--speed", "20") as demo:
        demo.sign_in()
        assert acknowledged <= samples(demo)
        cursor = str(last_event["cursor"] - 1)
        assert demo.get("/api/events", after=cursor, limit="1")["events"] == [last_event]
        assert demo.get(f"/api/plans/{plan}")["legs"] == legs
        maps = demo.get("/api/robots/mini-1/maps")
        assert maps, "no map is opened"
        assert name_signed_in(demo, "ann") == "ann"
        by_token = httpx.get(
            f"{demo.url}/api/robots", headers={"Authorization": f"Bearer {token}"}, timeout=60.0
        )
        assert by_token.status_code == 200
        demo.wait("the robot by its signed radio", lambda: is_live(demo), 60.0)
        assert demo.get("/api/backups")["backups"] == [], "it takes another station's for its own"
    assert file.exists()


def refused(file, data):
    """Return why a backup is not restored without its key; the folder stays as it is."""
    done = subprocess.run(
        [sys.executable, "-m", "server.cli", "db", "restore", str(file), "--data", str(data)],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 1
    assert {path.name for path in data.iterdir()} <= {"station.lock"}
    return done.stderr
