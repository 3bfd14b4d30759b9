"""Whether what a demo decided is decided the same once more: twice, and beside a busy machine.

A demo of two robots flies adaptive surveys for ``DECISIONS_MINUTES`` of the wall, twenty times as
fast as life; its maps are learned and compared, a plan is cancelled on the way. Then the command
line makes all decisions again.
"""

import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx

from benchmarks.calibration import NotMeasuredError
from benchmarks.field.field import row
from benchmarks.station.station_process import START_LIMIT_S, ended
from db.store import Store
from server.access.register import create_token
from server.access.role import Role
from server.base.settings import Settings

AREA = "decisions"
MINUTES = float(os.environ.get("DECISIONS_MINUTES", "30"))
ROBOTS = ("mini-1", "grace-1")
SPEED = "20"
_COUNTS = re.compile(r"(\d+) decisions: (\d+) same, (\d+) different, (\d+) that cannot")
_CANCELLED_S = 2.0
"""For how long a plan is searched for that is cancelled."""


def measure() -> list[dict[str, object]]:
    """Record a demo and make its decisions again."""
    with tempfile.TemporaryDirectory() as folder:
        _record(Path(folder))
        found = [_replayed(Path(folder)), _replayed(Path(folder))]
        with _busy(2 * (os.cpu_count() or 1)):
            found.append(_replayed(Path(folder)))
    names = ("made again", "a second time", "beside a busy machine")
    return [
        row(AREA, f"{count} decisions, {name}", same / count, "same", 1.0, same == count)
        for name, (count, same) in zip(names, found, strict=True)
    ]


def _record(folder: Path) -> None:
    command = [sys.executable, "-m", "server.cli", "demo", "--data", str(folder), "--no-browser"]
    command += ["--port", "0", "--speed", SPEED, "--robots", ",".join(ROBOTS)]
    log = folder / "demo.log"
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
    with ended(process), httpx.Client(base_url=_address(process, log), timeout=60) as client:
        client.headers["Authorization"] = f"Bearer {_token(folder)}"
        missions = [_survey(client, robot) for robot in ROBOTS]
        _cancel_one(client)
        until = time.monotonic() + 60.0 * MINUTES
        while time.monotonic() < until:
            for mission in missions:
                if client.get(f"/api/missions/{mission}").json()["state"] == "ready":
                    client.post(f"/api/missions/{mission}/start")
            time.sleep(1.0)
        for robot in ROBOTS:
            _judge_map(client, robot)


def _survey(client: httpx.Client, robot: str) -> str:
    limit_s = time.monotonic() + START_LIMIT_S
    while not client.get(f"/api/robots/{robot}/state").json().get("position"):
        if time.monotonic() > limit_s:
            raise NotMeasuredError(f"{robot} did not say where it is")
        time.sleep(0.5)
    body = {"kind": "adaptive_survey", "automation": True}
    answer = client.post(f"/api/robots/{robot}/missions", json=body)
    if not answer.is_success:
        raise NotMeasuredError(f"no survey of {robot}: {answer.text}")
    return answer.json()["id"]


def _cancel_one(client: httpx.Client) -> None:
    answer = client.post(f"/api/robots/{ROBOTS[0]}/plans", json={"kind": "adaptive_survey"})
    time.sleep(_CANCELLED_S)
    client.post(f"/api/plans/{answer.json()['id']}/cancel")


def _judge_map(client: httpx.Client, robot: str) -> None:
    for entry in client.get(f"/api/robots/{robot}/maps").json():
        for work in ("learning", "comparison"):
            answer = client.post(f"/api/robots/{robot}/maps/{entry['variable']}/{work}")
            if answer.is_success:
                _await_job(client, answer.json()["id"])


def _await_job(client: httpx.Client, job: str) -> None:
    while client.get(f"/api/jobs/{job}").json()["state"] in {"queued", "running"}:
        time.sleep(0.5)


def _address(process: subprocess.Popen[Any], log: Path) -> str:
    """Return where the station of a demo answers, once it does."""
    limit_s = time.monotonic() + START_LIMIT_S
    while time.monotonic() < limit_s and process.poll() is None:
        found = re.search(r"http://127\.0\.0\.1:\d+", log.read_text(errors="replace"))
        if found is not None:
            with suppress(httpx.TransportError):
                if httpx.get(f"{found[0]}/api/health").json()["ready"]:
                    return found[0]
        time.sleep(0.2)
    raise NotMeasuredError(f"the demo did not start: {log.read_text(errors='replace')[-300:]}")


def _token(folder: Path) -> str:
    store = Store.open(Settings(data_dir=folder).resolved_database_url)
    try:
        at = datetime.now(UTC)
        issued = store.change(
            lambda session: create_token(
                session, "benchmark", Role.PILOT, timedelta(days=1), at=at, by="benchmark"
            )
        ).result()
    finally:
        store.close()
    return issued.secret


def _replayed(folder: Path) -> tuple[int, int]:
    """Make the decisions of a folder again; return how many there are, and how many are the same.

    Raises:
        NotMeasuredError: If there is none, or the command did not come to its end.
    """
    command = [sys.executable, "-m", "server.cli", "journal", "replay", "--decisions"]
    said = subprocess.run(
        [*command, "--data", str(folder)], capture_output=True, text=True, check=False
    )
    found = _COUNTS.search(said.stdout)
    if found is None or found[1] == "0":
        raise NotMeasuredError(f"nothing was made again: {said.stdout}{said.stderr}"[-300:])
    print(said.stdout, file=sys.stderr)
    return int(found[1]), int(found[2])


@contextmanager
def _busy(processes: int) -> Generator[None]:
    """Keep all processors busy with something else."""
    workers = [multiprocessing.Process(target=_spin, daemon=True) for _ in range(processes)]
    for worker in workers:
        worker.start()
    try:
        yield
    finally:
        for worker in workers:
            worker.kill()
            worker.join()


def _spin() -> None:
    while True:
        sum(range(10_000))
