"""Surveys one site with several robots by REST: each plan counts what the others will sample.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/fleet_survey.py --robot mini-1 --robot mini-2

Needs only httpx, and rest.py beside it. Nothing is sent to the robots unless --send is given.
"""

import argparse
import os
import sys
import time

import httpx
from rest import get, post

ENDED = {"done", "failed", "stopped"}


def main() -> int:
    """Run the survey named on the command line."""
    arguments = parse()
    headers = {"Authorization": f"Bearer {os.environ['GRACE_TOKEN']}"}
    with httpx.Client(base_url=arguments.url, headers=headers, timeout=30.0) as station:
        missions = create_survey(station, arguments)
        for robot, mission in missions.items():
            plan = wait_for_draft(station, mission)
            account = plan["account"]
            print(
                f"{robot}: {plan['id']}, {len(plan['legs'])} legs, "
                f"{account['energy']:.1f} energy units, {account['surfacings']} surfacings"
            )
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        for mission in missions.values():
            post(station, f"/api/missions/{mission}/start")
        return follow(station, missions, arguments.timeout_s)


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", action="append", required=True, help="one for each robot")
    parser.add_argument("--target-std", type=float, help="end when the map is as sure as this")
    parser.add_argument("--total-budget", type=float)
    parser.add_argument("--timeout-s", type=float, default=7200.0)
    parser.add_argument("--send", action="store_true", help="really fly it")
    return parser.parse_args()


def create_survey(station: httpx.Client, arguments: argparse.Namespace) -> dict[str, str]:
    """Ask the robots for one survey; return the mission of each."""
    config = {"target_std": arguments.target_std, "total_budget": arguments.total_budget}
    body = {
        "robots": arguments.robot,
        "config": {name: value for name, value in config.items() if value is not None},
    }
    missions = post(station, "/api/surveys", body)["missions"]
    return {one["robot"]: one["mission"] for one in missions}


def wait_for_draft(station: httpx.Client, mission: str) -> dict:
    """Wait until the first round's plan is there to be looked at."""
    while True:
        state = get(station, f"/api/missions/{mission}")
        if state["state"] == "ready":
            return get(station, f"/api/plans/{state['plan_id']}")
        if state["state"] in ENDED:
            sys.exit(f"{mission}: {state['message']}")
        time.sleep(0.5)


def follow(station: httpx.Client, missions: dict[str, str], timeout_s: float) -> int:
    """Print every change until all missions end; return 0 if all of them are done."""
    shown: dict[str, str] = {}
    give_up = time.monotonic() + timeout_s
    while time.monotonic() < give_up:
        states = {robot: get(station, f"/api/missions/{one}") for robot, one in missions.items()}
        for robot, state in states.items():
            std = state["map_std"]
            line = f"{robot}: {state['state']}, round {len(state['rounds'])}"
            line += "" if std is None else f", the map's standard deviation is {std:.3g}"
            if shown.get(robot) != line:
                print(line, flush=True)
                shown[robot] = line
        if all(state["state"] in ENDED for state in states.values()):
            return int(any(state["state"] != "done" for state in states.values()))
        time.sleep(1.0)
    sys.exit(f"the survey has not ended after {timeout_s:.0f} s")


if __name__ == "__main__":
    sys.exit(main())
