"""Plans whenever a robot surfaces, by the station's events: nothing is polled, and none is missed.

    export GRACE_TOKEN=$(grace token create --role pilot --data DIR)
    python examples/plan_on_surfacing.py --url http://127.0.0.1:8000 --robot mini-1

On each `robot.surfaced` it asks for a plan, waits for its dry run and prints what both say. With
--send the plan is sent and started; while another is flown it waits on board for the next
surfacing. --cursor FILE keeps the place in the event log, so that a script that was stopped goes on
after the last event that it has done. Needs grace_client.
"""

import argparse
import os
import sys

from grace_client import Station


def main() -> int:
    """Plan on every surfacing until enough were seen."""
    arguments = parse()
    token = os.environ["GRACE_TOKEN"]
    with Station(arguments.url, token, may_send=arguments.send) as station:
        surfacings = station.events("robot.surfaced", robot=arguments.robot, file=arguments.cursor)
        for done, event in enumerate(surfacings, 1):
            data = event.data
            print(
                f"{event.text} Measured at {data['measured_at']}, "
                f"received at {data['received_at']}, by {data['by']}.",
                flush=True,
            )
            plan_once(station, arguments)
            if done == arguments.times:
                surfacings.done(event)
                return 0
    return 0


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--url", default="http://127.0.0.1:8000")
    parser.add_argument("--robot", default="mini-1")
    parser.add_argument("--depth-m", type=float, default=0.5)
    parser.add_argument("--cursor", help="file that keeps the place in the event log")
    parser.add_argument("--times", type=int, default=0, help="surfacings to plan on; 0 for ever")
    parser.add_argument("--send", action="store_true", help="really send what was planned")
    return parser.parse_args()


def plan_once(station: Station, arguments: argparse.Namespace) -> None:
    """Plan a dive here, see what its dry run says, and send it if that is wanted."""
    here = station.ask.robots.get_state(arguments.robot).position
    if here is None:
        print(f"{arguments.robot} has not said where it is")
        return
    north, east, _ = here.ned_m
    legs = [
        {"kind": "dive", "end_ned": [north, east, arguments.depth_m]},
        {"kind": "dive", "end_ned": [north, east, 0.0]},
    ]
    plan = station.plan(arguments.robot, legs)
    if plan.state != "draft" or plan.account is None:
        print(f"{plan.id}: {plan.message}")
        return
    dry_run = "no dry run" if plan.rehearsal is None else plan.rehearsal.message
    print(
        f"{plan.id}: {plan.account.energy:.1f} energy units, {plan.account.duration_s:.0f} s; "
        f"{dry_run}",
        flush=True,
    )
    if not arguments.send:
        print("nothing was sent; add --send to fly it", flush=True)
        return
    print(station.send(plan.id, start=True).text, flush=True)


if __name__ == "__main__":
    sys.exit(main())
