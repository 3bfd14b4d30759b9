"""Surveys one site with several robots: each plan counts what the others will sample.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/fleet_survey.py --robot mini-1 --robot mini-2

Needs grace_client. Nothing is sent to the robots unless --send is given.
"""

import argparse
import asyncio
import os
import sys

from grace_client import AsyncStation, models

ENDED = ("done", "failed", "stopped")


async def main() -> int:
    """Run the survey named on the command line."""
    arguments = parse()
    token = os.environ["GRACE_TOKEN"]
    async with AsyncStation(arguments.url, token, may_send=arguments.send) as station:
        survey = await station.ask.missions.create_survey(wanted(arguments))
        missions = {one.robot: one.mission for one in survey.missions}
        drafts = [tell_draft(station, *one) for one in missions.items()]
        if not all(await asyncio.gather(*drafts)):
            return 1
        if not arguments.send:
            print("nothing was sent; add --send to fly it")
            return 0
        for mission in missions.values():
            await station.ask.missions.start_mission(mission)
        ends = [follow(station, *one, arguments.timeout_s) for one in missions.items()]
        return int(not all(await asyncio.gather(*ends)))


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", action="append", required=True, help="one for each robot")
    parser.add_argument("--target-std", type=float, help="end when the map is as sure as this")
    parser.add_argument("--total-budget", type=float)
    parser.add_argument("--planning-time-s", type=float)
    parser.add_argument("--timeout-s", type=float, default=7200.0)
    parser.add_argument("--send", action="store_true", help="really fly it")
    return parser.parse_args()


def wanted(arguments: argparse.Namespace) -> models.SurveyRequest:
    """Return which robots shall survey, and what differs from their own settings."""
    names = ("target_std", "total_budget", "planning_time_s")
    config = {name: getattr(arguments, name) for name in names}
    return models.SurveyRequest(
        robots=arguments.robot,
        config={name: value for name, value in config.items() if value is not None},
    )


async def tell_draft(station: AsyncStation, robot: str, mission: str) -> bool:
    """Wait until the first round's plan of a robot is there, and print what it takes."""
    ready = await station.wait_for_mission(mission, "ready")
    if ready.state != "ready" or ready.plan_id is None:
        print(f"{robot}: {ready.message}")
        return False
    plan = await station.ask.transfers.get_plan(ready.plan_id)
    if plan.account is not None:
        print(
            f"{robot}: {plan.id}, {len(plan.legs)} legs, {plan.account.energy:.1f} energy units, "
            f"{plan.account.surfacings} surfacings"
        )
    return True


async def follow(station: AsyncStation, robot: str, mission: str, timeout_s: float) -> bool:
    """Print every change of a robot's mission until it ends; tell whether it is done."""
    shown = ""
    async for state in station.changes_of_mission(mission, timeout_s=timeout_s):
        line = f"{robot}: {state.state}, round {len(state.rounds)}"
        if state.map_std is not None:
            line += f", the map's standard deviation is {state.map_std:.3g}"
        if line != shown:
            print(line, flush=True)
            shown = line
        if state.state in ENDED:
            return state.state == "done"
    print(f"{robot}: {mission} has not ended after {timeout_s:.0f} s")
    return False


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
