"""Follows a target by a script: plan, start, watch, go quiet, ping again, come up.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/track_target.py --url http://127.0.0.1:8000 --robot mini-1

Needs grace_client. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys
import time
from datetime import datetime
from typing import Any, Literal

from grace_client import Station, models

ENDED = ("done", "failed", "superseded", "cancelled")
LOOK_S = 0.5


def main() -> int:
    """Run the mission named on the command line."""
    arguments = parse()
    token = os.environ["GRACE_TOKEN"]
    with Station(arguments.url, token, may_send=arguments.send) as station:
        plan = make_plan(station, arguments)
        show(plan)
        if plan.violations:
            return 1
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        station.send(plan.id, start=True)
        watch = Watch(station, arguments.robot, plan.id, arguments.timeout_s)
        watch.until("tracking")
        watch.during(arguments.watch_s)
        if arguments.pull:
            tell(station, arguments.robot, "quiet", arguments.timeout_s)
            watch.until("lost")
            tell(station, arguments.robot, "ping", arguments.timeout_s)
            watch.until("tracking")
            watch.during(arguments.watch_s)
        up = station.surface_now(arguments.robot)
        print(station.wait_for_command(up.id, timeout_s=arguments.timeout_s).text, flush=True)
        return report(station.wait_for_plan(plan.id, timeout_s=arguments.timeout_s))


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


def make_plan(station: Station, arguments: argparse.Namespace) -> models.PlanView:
    """Ask for a plan of the robot's own settings where nothing is said; it is a draft at once."""
    target = {
        "kind": arguments.target,
        "address": arguments.address,
        "north_m": arguments.north_m,
        "east_m": arguments.east_m,
    }
    config: dict[str, dict[str, Any]] = {
        "target": {name: value for name, value in target.items() if value is not None}
    }
    if arguments.duration_s is not None:
        config["motion"] = {"duration_s": arguments.duration_s}
    config["barrier"] = {"controller": "nominal" if arguments.teaching else None}
    wanted = models.TargetPlanRequest(kind="track_target", config=config)
    return station.plan(arguments.robot, wanted)


def show(plan: models.PlanView) -> None:
    """Print what the plan is and what speaks against it."""
    size = "" if plan.account is None else f" {plan.account.bytes} bytes"
    print(f"{plan.id}: {plan.message}{size}", flush=True)
    for warning in plan.warnings:
        print(f"note ({warning.field}): {warning.message}")
    for violation in plan.violations:
        print(f"it breaks {violation.field}: {violation.message}")


class Watch:
    """Prints what the robot says of its target whenever that is news."""

    def __init__(self, station: Station, robot: str, plan: str, timeout_s: float) -> None:
        self._station = station
        self._robot = robot
        self._plan = plan
        self._timeout_s = timeout_s
        self._after: datetime | None = None

    def until(self, phase: str) -> None:
        """Wait for a phase; give up where the mission ends before."""
        give_up = time.monotonic() + self._timeout_s
        while time.monotonic() < give_up:
            if any(one.phase == phase for one in self._news()):
                return
            plan = self._station.ask.transfers.get_plan(self._plan)
            if plan.state in ENDED:
                sys.exit(plan.message)
            time.sleep(LOOK_S)
        sys.exit(f"the target was not {phase} within {self._timeout_s:.0f} s")

    def during(self, wall_s: float) -> None:
        """Watch for a while."""
        end = time.monotonic() + wall_s
        while time.monotonic() < end:
            self._news()
            time.sleep(LOOK_S)

    def _news(self) -> list[models.TargetReportView]:
        tracking = self._station.ask.tracking
        reports = tracking.get_tracking(self._robot, plan=self._plan, after=self._after).reports
        if reports:
            newest = reports[-1]
            self._after = newest.measured_at
            off = "" if newest.error_m is None else f" It is off by {newest.error_m:.2f} m."
            print(f"{newest.text}{off} Observability {newest.inverse_condition:.2f}.", flush=True)
        return reports


def tell(station: Station, robot: str, kind: Literal["quiet", "ping"], timeout_s: float) -> None:
    """Give an order and wait until the robot has answered it."""
    command = station.command(robot, kind)
    print(station.wait_for_command(command.id, timeout_s=timeout_s).text, flush=True)


def report(plan: models.PlanView) -> int:
    """Print how the mission ended; one that was told to come up did as it was told."""
    print(f"{plan.id} is {plan.state}. {plan.message}")
    return 0 if plan.state in ("done", "cancelled") else 1


if __name__ == "__main__":
    sys.exit(main())
