"""Flies a whole adaptive survey by REST alone: plan, upload, wait, print the final scores.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/adaptive_survey.py --url http://127.0.0.1:8000 --robot mini-1

Needs only httpx, and rest.py beside it. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys
import time

import httpx
from rest import get, post


def main() -> int:
    """Run the survey named on the command line."""
    arguments = parse()
    headers = {"Authorization": f"Bearer {os.environ['GRACE_TOKEN']}"}
    with httpx.Client(base_url=arguments.url, headers=headers, timeout=30.0) as station:
        mission = create_mission(station, arguments)
        plan = wait_for_draft(station, mission)
        account = plan["account"]
        print(
            f"{plan['id']}: {len(plan['legs'])} legs, {account['energy']:.1f} energy units, "
            f"{account['duration_s']:.0f} s, worst expected uncertainty "
            f"{account['worst_std_m']:.2f} m"
        )
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        post(station, f"/api/missions/{mission}/start")
        return report(follow(station, mission, arguments.timeout_s))


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", default="mini-1")
    parser.add_argument("--objective", choices=["information_gain", "ergodic"])
    parser.add_argument("--total-budget", type=float)
    parser.add_argument("--planning-time-s", type=float)
    parser.add_argument("--timeout-s", type=float, default=7200.0)
    parser.add_argument("--send", action="store_true", help="really fly it")
    return parser.parse_args()


def create_mission(station: httpx.Client, arguments: argparse.Namespace) -> str:
    """Ask for an adaptive survey with the robot's own defaults where nothing is said."""
    config = {
        "objective": arguments.objective,
        "total_budget": arguments.total_budget,
        "planning_time_s": arguments.planning_time_s,
    }
    body = {
        "kind": "adaptive_survey",
        "config": {name: value for name, value in config.items() if value is not None},
    }
    return post(station, f"/api/robots/{arguments.robot}/missions", body)["id"]


def wait_for_draft(station: httpx.Client, mission: str) -> dict:
    """Wait until the first round's plan is there to be looked at."""
    while True:
        state = get(station, f"/api/missions/{mission}")
        if state["state"] == "ready":
            return get(station, f"/api/plans/{state['plan_id']}")
        if state["state"] in {"failed", "stopped"}:
            sys.exit(f"{mission}: {state['message']}")
        time.sleep(0.5)


def follow(station: httpx.Client, mission: str, timeout_s: float) -> dict:
    """Print every change of the mission until it ends."""
    shown = ""
    give_up = time.monotonic() + timeout_s
    while time.monotonic() < give_up:
        state = get(station, f"/api/missions/{mission}")
        budget = state["budget"]
        line = (
            f"{state['state']}: round {len(state['rounds'])}, "
            f"{budget['spent']:.0f} of {budget['total']:.0f} energy units spent"
        )
        if line != shown:
            print(line, flush=True)
            shown = line
        if state["state"] in {"done", "failed", "stopped"}:
            return state
        time.sleep(1.0)
    sys.exit(f"{mission} is still {shown} after {timeout_s:.0f} s")


def report(mission: dict) -> int:
    """Print the final scores of the map against the simulated truth."""
    if mission["state"] != "done":
        print(mission["message"])
        return 1
    for score in mission["scores"] or []:
        print(
            f"{score['title']}: RMSE {score['rmse']:.3f}, NLPD {score['nlpd']:.3f}, "
            f"WMSE {score['wmse']:.3f}, 90 % coverage {score['coverage_90']:.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
