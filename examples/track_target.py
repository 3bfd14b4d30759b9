"""Follows a target by REST alone: plan, start, watch, go quiet, ping again, come up.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/track_target.py --url http://127.0.0.1:8000 --robot mini-1

Needs only httpx, and rest.py beside it. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys
import time

import httpx
from rest import get, post

ENDED = ("done", "failed", "superseded", "cancelled")


def main() -> int:
    """Run the mission named on the command line."""
    arguments = parse()
    headers = {"Authorization": f"Bearer {os.environ['GRACE_TOKEN']}"}
    with httpx.Client(base_url=arguments.url, headers=headers, timeout=30.0) as station:
        plan = make_plan(station, arguments)
        show(plan)
        if plan["violations"]:
            return 1
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        post(station, f"/api/plans/{plan['id']}/upload", {"start": True})
        watch = Watch(station, arguments.robot, plan["id"], arguments.timeout_s)
        watch.until("tracking")
        watch.during(arguments.watch_s)
        if arguments.pull:
            tell(station, arguments.robot, "quiet", arguments.timeout_s)
            watch.until("lost")
            tell(station, arguments.robot, "ping", arguments.timeout_s)
            watch.until("tracking")
            watch.during(arguments.watch_s)
        tell(station, arguments.robot, "surface", arguments.timeout_s)
        return report(watch.until_ended())


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", default="mini-1")
    parser.add_argument("--target", choices=["virtual", "tag", "beacon"])
    parser.add_argument("--address", type=int, help="acoustic address of a tag or beacon")
    parser.add_argument("--north-m", type=float, help="where the target is, or is guessed to be")
    parser.add_argument("--east-m", type=float)
    parser.add_argument("--duration-s", type=float, help="by the robot's clock")
    parser.add_argument(
        "--teaching", action="store_true", help="without the barrier: the estimate may diverge"
    )
    parser.add_argument("--watch-s", type=float, default=20.0, help="time to watch, by the wall")
    parser.add_argument(
        "--pull", action="store_true", help="stop pinging until the target is lost, then go on"
    )
    parser.add_argument("--timeout-s", type=float, default=600.0, help="for each step")
    parser.add_argument("--send", action="store_true", help="really fly it")
    return parser.parse_args()


def make_plan(station: httpx.Client, arguments: argparse.Namespace) -> dict:
    """Ask for a plan of the robot's own settings where nothing is said; it is a draft at once."""
    target = {
        "kind": arguments.target,
        "address": arguments.address,
        "north_m": arguments.north_m,
        "east_m": arguments.east_m,
    }
    config: dict[str, dict] = {
        "target": {name: value for name, value in target.items() if value is not None}
    }
    if arguments.duration_s is not None:
        config["motion"] = {"duration_s": arguments.duration_s}
    config["barrier"] = {"controller": "nominal" if arguments.teaching else None}
    body = {"kind": "track_target", "config": config}
    plan = post(station, f"/api/robots/{arguments.robot}/plans", body)["id"]
    return get(station, f"/api/plans/{plan}")


def show(plan: dict) -> None:
    """Print what the plan is and what speaks against it."""
    account = plan["account"]
    print(f"{plan['id']}: {plan['message']} {account['bytes']} bytes", flush=True)
    for warning in plan["warnings"]:
        print(f"note ({warning['field']}): {warning['message']}")
    for violation in plan["violations"]:
        print(f"it breaks {violation['field']}: {violation['message']}")


class Watch:
    """Prints what the robot says of its target whenever that is news."""

    def __init__(self, station: httpx.Client, robot: str, plan: str, timeout_s: float) -> None:
        self._station = station
        self._robot = robot
        self._plan = plan
        self._timeout_s = timeout_s
        self._after: str | None = None
        self.errors_m: list[float] = []
        """How far the estimate was from the truth, of a virtual target."""

    def until(self, phase: str) -> None:
        """Wait for a phase; give up where the mission ends before."""
        give_up = time.monotonic() + self._timeout_s
        while time.monotonic() < give_up:
            if any(one["phase"] == phase for one in self._news()):
                return
            if self._state() in ENDED:
                sys.exit(get(self._station, f"/api/plans/{self._plan}")["message"])
            time.sleep(0.5)
        sys.exit(f"the target was not {phase} within {self._timeout_s:.0f} s")

    def during(self, wall_s: float) -> None:
        """Watch for a while."""
        end = time.monotonic() + wall_s
        while time.monotonic() < end and self._state() not in ENDED:
            self._news()
            time.sleep(0.5)

    def until_ended(self) -> dict:
        """Wait for the end of the mission and return the plan."""
        give_up = time.monotonic() + self._timeout_s
        while time.monotonic() < give_up:
            self._news()
            if self._state() in ENDED:
                return get(self._station, f"/api/plans/{self._plan}")
            time.sleep(0.5)
        sys.exit(f"{self._plan} did not end within {self._timeout_s:.0f} s")

    def _state(self) -> str:
        return get(self._station, f"/api/plans/{self._plan}")["state"]

    def _news(self) -> list[dict]:
        asked = {"plan": self._plan, **({} if self._after is None else {"after": self._after})}
        reports = get(self._station, f"/api/robots/{self._robot}/tracking", **asked)["reports"]
        if reports:
            newest = reports[-1]
            self._after = newest["measured_at"]
            self.errors_m += [one["error_m"] for one in reports if one["error_m"] is not None]
            error = newest["error_m"]
            off = "" if error is None else f" It is off by {error:.2f} m."
            gauge = f" Observability {newest['inverse_condition']:.2f}."
            print(f"{newest['text']}{off}{gauge}", flush=True)
        return reports


def tell(station: httpx.Client, robot: str, kind: str, timeout_s: float) -> None:
    """Send a command and wait until the robot has answered it."""
    command = post(station, f"/api/robots/{robot}/commands", {"kind": kind})["id"]
    give_up = time.monotonic() + timeout_s
    while time.monotonic() < give_up:
        found = get(station, f"/api/commands/{command}")
        if found["level"] in ("applied", "refused", "expired"):
            print(found["text"], flush=True)
            return
        time.sleep(0.5)
    sys.exit(f"{command} ({kind}) was not answered within {timeout_s:.0f} s")


def report(plan: dict) -> int:
    """Print how the mission ended; one that was told to come up did as it was told."""
    print(f"{plan['id']} is {plan['state']}. {plan['message']}")
    return 0 if plan["state"] in ("done", "cancelled") else 1


if __name__ == "__main__":
    sys.exit(main())
