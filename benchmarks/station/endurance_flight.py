"""A robot of a demo that is sent out again whenever it is back."""

import itertools
import time
from dataclasses import dataclass
from typing import Any, Final

import httpx

FRESH_BELOW: Final = 0.4
"""Charge below which the battery is changed before the next flight."""
FLAT_S: Final = 2.0
"""How long a battery stays flat before it is changed: the simulator must have noticed."""
DIVES: Final = 6
SURVEY_EVERY: Final = 4
"""Each fourth flight of the tank's robot is a survey, with planning and a map."""
DEPTH_M: Final = {"mini-1": 0.5, "grace-1": 5.0}
DRAFT_DISTANCE_M: Final = {"mini-1": 3.0, "grace-1": 50.0}
TANK_INSIDE_M: Final = ((0.4, 2.3), (0.4, 0.9))
"""Where the tank's robot dives, north and east: away from its walls."""


@dataclass(frozen=True, slots=True)
class _Kind:
    """Where a flight of a kind is asked for, looked at, and begun."""

    create: str
    look: str
    begin: str
    begin_body: Any
    ready: str
    failed: tuple[str, ...]


DIVE: Final = _Kind(
    "plans", "/api/plans/{}", "/upload", {"start": True}, "draft", ("failed", "cancelled")
)
SURVEY: Final = _Kind(
    "missions", "/api/missions/{}", "/start", None, "ready", ("failed", "stopped")
)


class KeptFlying:
    """Moves one robot's flights on by REST; ``step`` asks once and never waits.

    Args:
        client: Signed in as somebody who may fly the robot and cause faults.
        robot: Its id.
    """

    def __init__(self, client: httpx.Client, robot: str) -> None:
        self.robot = robot
        self._client = client
        self._numbers = itertools.count(1)
        self._flight: tuple[_Kind, str] | None = None
        self._flat_since_s: float | None = None
        self._counts = {"done": 0, "failed": 0, "batteries": 0, "refused": 0}
        self._last_refusal = ""

    def told(self) -> dict[str, Any]:
        """Return what came of the flights so far."""
        return {**self._counts, "last_refusal": self._last_refusal}

    def step(self) -> None:
        """Ask how the flight is, and do what comes next; a refusal is noted and tried again."""
        try:
            if self._flat_since_s is not None:
                self._change_battery(self._flat_since_s)
            elif self._flight is None:
                self._send_out()
            else:
                self._follow(*self._flight)
        except httpx.HTTPStatusError as error:
            self._flight = None
            self._refused(f"{error.response.status_code} {error.response.text[:300]}")
        except httpx.HTTPError as error:
            self._refused(repr(error))

    def _send_out(self) -> None:
        state = self._ask("GET", f"/api/robots/{self.robot}/state")
        if state["position"] is None:
            return
        charge = state["channels"]["battery_fraction"]["value"]
        if charge < FRESH_BELOW:
            self._ask("PUT", self._battery_fault)
            self._flat_since_s = time.monotonic()
            return
        is_survey = self.robot == "mini-1" and next(self._numbers) % SURVEY_EVERY == 0
        kind = SURVEY if is_survey else DIVE
        wish = _survey() if is_survey else _dives(self.robot, state["position"]["ned_m"])
        made = self._ask("POST", f"/api/robots/{self.robot}/{kind.create}", wish)
        self._flight = (kind, made["id"])

    def _follow(self, kind: _Kind, flight: str) -> None:
        address = kind.look.format(flight)
        state = self._ask("GET", address)["state"]
        if state == kind.ready:
            self._ask("POST", f"{address}{kind.begin}", kind.begin_body)
        elif state == "done" or state in kind.failed:
            self._counts["done" if state == "done" else "failed"] += 1
            self._flight = None

    def _change_battery(self, flat_since_s: float) -> None:
        if time.monotonic() - flat_since_s >= FLAT_S:
            self._ask("DELETE", self._battery_fault)
            self._counts["batteries"] += 1
            self._flat_since_s = None

    @property
    def _battery_fault(self) -> str:
        return f"/api/demo/faults/{self.robot}/battery"

    def _ask(self, method: str, path: str, body: Any = None) -> Any:
        answer = self._client.request(method, path, json=body).raise_for_status()
        return answer.json() if answer.content else None

    def _refused(self, sentence: str) -> None:
        self._counts["refused"] += 1
        self._last_refusal = sentence


def _survey() -> dict[str, Any]:
    config = {"total_budget": 24.0, "round_budget": 12.0, "planning_time_s": 5.0}
    return {"kind": "adaptive_survey", "config": config}


def _dives(robot: str, position_ned: list[float]) -> dict[str, Any]:
    """Return the wish for dives where a robot is; near a wall of the tank it swims inward first."""
    here = position_ned[:2]
    legs: list[dict[str, Any]] = []
    if robot == "mini-1":
        inside = [_clamped(one, *limits) for one, limits in zip(here, TANK_INSIDE_M, strict=True)]
        if inside != here:
            legs.append({"kind": "swim", "end_ned": [*inside, 0.0]})
        here = inside
    for _ in range(DIVES):
        legs += [{"kind": "dive", "end_ned": [*here, depth]} for depth in (DEPTH_M[robot], 0.0)]
    mission = {"draft_distance_m": DRAFT_DISTANCE_M[robot], "draft_age_s": 86_400.0}
    config = {"total_budget": 400.0, "round_budget": 400.0, "mission": mission}
    return {"kind": "primitives", "legs": legs, "config": config}


def _clamped(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)
