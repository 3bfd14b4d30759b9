"""A real demo as a user starts it: supervisor, station and simulator as processes."""

import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self, TypeAlias, TypeVar

import httpx

T = TypeVar("T")
Json: TypeAlias = dict[str, Any]
"""What the station answers; a test looks into it and so says what it expects there."""

ROOT = Path(__file__).parents[2]
OURS = "mini-1,grace-1"
START_LIMIT_S = 240.0
STOP_LIMIT_S = 120.0
PATIENCE = 6.0
"""What a slow or busy machine gets of each limit."""
LASTING = {"mission": {"draft_age_s": 604_800.0, "draft_distance_m": 1000.0}}
"""Settings by which no draft is outdated: a slow machine looks at one for hours of demo time."""


class Demo:
    """Starts ``grace demo`` in a data folder and talks to it.

    ``grace``, ``folder`` and ``environment`` say which one, where, and with which variables. It has
    our two robots alone unless the options name others.
    """

    def __init__(
        self,
        data: Path,
        *options: str,
        grace: Sequence[str] = (sys.executable, "-m", "server.cli"),
        folder: Path = ROOT,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.data = data
        self._lines: list[str] = []
        robots = () if "--robots" in options else ("--robots", OURS)
        self._process = subprocess.Popen(
            [*grace, "demo", "--data", str(data), "--port", "0", "--no-browser", *robots, *options],
            cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            text=True, start_new_session=True,
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.sign_in_url = self._wait_for_url()
        self.url = self.sign_in_url.split("/sign-in")[0]
        self.client = httpx.Client(base_url=self.url, timeout=60.0, follow_redirects=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._lines.append(line)

    def _wait_for_url(self) -> str:
        give_up = time.monotonic() + START_LIMIT_S
        while time.monotonic() < give_up and self._process.poll() is None:
            found = re.search(r"http://\S+/sign-in\?token=\S+", "".join(self._lines))
            if found:
                return found[0]
            time.sleep(0.05)
        self.stop()
        raise AssertionError(f"the demo printed no address:\n{self.output}")

    @property
    def output(self) -> str:
        return "".join(self._lines)

    def sign_in(self) -> None:
        self.client.get(self.sign_in_url).raise_for_status()
        session = self.client.get("/api/session").raise_for_status().json()
        self.client.headers["X-CSRF-Token"] = session["csrf_token"]

    def get(self, path: str, **query: str) -> Json:
        return self.client.get(path, params=query).raise_for_status().json()

    def patch(self, path: str, body: Mapping[str, object], **query: str) -> None:
        self.client.patch(path, params=query, json=body).raise_for_status()

    def post(self, path: str, body: Mapping[str, object] | None = None) -> Json:
        answer = self.client.post(path, json=body or {})
        assert answer.is_success, f"{path}: {answer.status_code} {answer.text}"
        return answer.json()

    def wait(self, what: str, condition: Callable[[], T], limit_s: float) -> T:
        """Ask until ``condition()`` gives something true; a station that restarts is waited for.

        ``limit_s`` is what a quiet machine needs at most.
        """
        limit_s *= PATIENCE
        give_up = time.monotonic() + limit_s
        last: object = None
        while time.monotonic() < give_up:
            try:
                last = condition()
            except (httpx.HTTPError, httpx.TransportError) as error:
                last = error
            else:
                if last:
                    return last
            time.sleep(0.25)
        raise AssertionError(f"{what} did not happen within {limit_s} s; last: {last}\n{self.tail}")

    @property
    def tail(self) -> str:
        return "".join(self._lines[-40:])

    def children(self) -> dict[str, int]:
        """Process ids of the supervisor's children by the verb they run."""
        found: dict[str, int] = {}
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                words = (entry / "cmdline").read_bytes().decode().split("\0")
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except (OSError, ValueError):
                continue
            if parent == self._process.pid:
                for verb in ("serve", "simulate"):
                    if verb in words:
                        found[verb] = int(entry.name)
        return found

    def restart_station(self) -> None:
        """Kill the station as a power cut would, and wait for the one that takes its place."""
        old = self.children()["serve"]
        os.kill(old, signal.SIGKILL)
        self.wait("a new station", lambda: self.children().get("serve", old) != old, 30.0)
        self.wait("its health", lambda: self.get("/api/health")["ready"], 30.0)

    def stop(self) -> int:
        """Press Ctrl-C as a terminal does: the whole foreground group gets it."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGINT)
            try:
                self._process.wait(STOP_LIMIT_S)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
                raise AssertionError(f"the demo did not end after Ctrl-C:\n{self.tail}") from None
        self._reader.join(5.0)
        if self._process.stdout is not None:
            self._process.stdout.close()
        if hasattr(self, "client"):
            self.client.close()
        return self._process.returncode


def alive(pid: int) -> bool:
    try:
        state = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def fly_dives(demo: Demo, count: int, depth_m: float) -> str:
    """Plan dives of mini-1 where it is, let it fly them, and return the plan.

    A robot that was just turned off a wall glides on while its plan is rehearsed; where it came
    too far from where the plan begins it gets another.
    """

    def plan_that_fits() -> str | None:
        plan = demo.post("/api/robots/mini-1/plans", _dives(demo, count, depth_m))["id"]
        demo.wait("draft", lambda: demo.get(f"/api/plans/{plan}")["state"] == "draft", 60.0)
        answer = demo.client.post(f"/api/plans/{plan}/upload", json={"start": True})
        if answer.status_code == 409 and "mission.draft_distance_m" in answer.text:
            return None
        assert answer.is_success, f"{answer.status_code} {answer.text}"
        return plan

    plan = demo.wait("a plan that fits where the robot is", plan_that_fits, 60.0)
    assert plan is not None
    return plan


def _dives(demo: Demo, count: int, depth_m: float) -> Json:
    """Return the wish for a plan of dives of mini-1 where it is, with energy enough for any way."""
    legs = dives_inside(demo, [depth_m, 0.0] * count)
    config = {
        "total_budget": 80.0,
        "round_budget": 80.0,
        "mission": {"draft_distance_m": 1.0},
    }
    return {"kind": "primitives", "legs": legs, "config": config}


def dives_inside(demo: Demo, depths_m: Sequence[float]) -> list[Json]:
    """Return legs of mini-1 to depths, one after the other, where it is.

    Where it drifted near the edge of its domain, which no dive may leave, it swims inward first.
    """
    place = demo.wait("a position", lambda: demo.get("/api/robots/mini-1/state")["position"], 60.0)
    north, east, _ = place["ned_m"]
    inside = [min(max(north, 0.4), 2.3), min(max(east, 0.4), 0.9)]
    is_near_edge = math.dist(inside, (north, east)) > 0.3
    here = inside if is_near_edge else [north, east]
    way = [{"kind": "swim", "end_ned": [*inside, 0.0]}] if is_near_edge else []
    return [*way, *({"kind": "dive", "end_ned": [*here, depth_m]} for depth_m in depths_m)]
