"""Flies a whole adaptive survey by a script: plan, send, wait, print the final scores.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/adaptive_survey.py --url http://127.0.0.1:8000 --robot mini-1

Needs grace_client. Nothing is sent to the robot unless --send is given.
"""

import argparse
import os
import sys

from grace_client import Station, models

ENDED = ("done", "failed", "stopped")


def main() -> int:
    """Run the survey named on the command line."""
    arguments = parse()
    token = os.environ["GRACE_TOKEN"]
    with Station(arguments.url, token, may_send=arguments.send) as station:
        wanted = models.MissionRequest(kind="adaptive_survey", config=config_of(arguments))
        mission = station.ask.missions.create_mission(arguments.robot, wanted).id
        ready = station.wait_for_mission(mission, "ready")
        if ready.plan_id is None or ready.state != "ready":
            print(f"{mission}: {ready.message}")
            return 1
        tell(station.ask.transfers.get_plan(ready.plan_id))
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        station.ask.missions.start_mission(mission)
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


def config_of(arguments: argparse.Namespace) -> dict[str, object]:
    """Return what differs from the robot's own settings."""
    config = {
        "objective": arguments.objective,
        "total_budget": arguments.total_budget,
        "planning_time_s": arguments.planning_time_s,
    }
    return {name: value for name, value in config.items() if value is not None}


def tell(plan: models.PlanView) -> None:
    """Print what the first round takes."""
    account = plan.account
    if account is not None:
        print(
            f"{plan.id}: {len(plan.legs)} legs, {account.energy:.1f} energy units, "
            f"{account.duration_s:.0f} s, worst expected uncertainty {account.worst_std_m:.2f} m"
        )


def follow(station: Station, mission: str, timeout_s: float) -> models.MissionView:
    """Print every change of the mission until it ends."""
    shown = ""
    for state in station.changes_of_mission(mission, timeout_s=timeout_s):
        line = (
            f"{state.state}: round {len(state.rounds)}, "
            f"{state.budget.spent:.0f} of {state.budget.total:.0f} energy units spent"
        )
        if line != shown:
            print(line, flush=True)
            shown = line
        if state.state in ENDED:
            return state
    sys.exit(f"{mission} is still {shown} after {timeout_s:.0f} s")


def report(mission: models.MissionView) -> int:
    """Print the final scores of the map against the simulated truth."""
    if mission.state != "done":
        print(mission.message)
        return 1
    for score in mission.scores or []:
        print(
            f"{score.title}: RMSE {score.rmse:.3f}, NLPD {score.nlpd:.3f}, "
            f"WMSE {score.wmse:.3f}, 90 % coverage {score.coverage_90:.2f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
