"""Plans that are asked for by when they were flown."""

from datetime import timedelta

from sqlalchemy import update
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.identity import key_of
from db.query.fleet.robots import add_robot
from db.query.mission.plans import add_plan, flown_plans
from db.tables import Plan
from tests.db.conftest import START, robot_record

FLOWN = ("running", "done")


def test_plans_that_a_robot_flew_within_a_period_are_found(store):
    def hour(number):
        return START + timedelta(hours=number)

    def add(session: Session, state: str, begun: int | None, ended: int | None, robot="mini-1"):
        plan = add_plan(session, robot, "primitives", config={}, at=START, by="pilot")
        times = {
            "running_at": None if begun is None else hour(begun),
            "ended_at": None if ended is None else hour(ended),
        }
        row = Plan.key == key_of("plan", plan)
        session.execute(update(Plan).where(row).values(state=state, **times))
        return plan

    def fill(session: Session):
        add_robot(session, robot_record("grace-1", 2))
        add(session, "done", 0, 1)
        over = [add(session, "done", 1, 2), add(session, "done", 1, 9), add(session, "done", 4, 5)]
        over += [add(session, "running", 3, None)]
        add(session, "done", 7, 8)
        add(session, "draft", None, None)
        add(session, "cancelled", 3, 4)
        add(session, "done", 3, 4, "grace-1")
        return over

    over = store.change(fill).result()

    def found(first, last, limit=100):
        period = Period(hour(first), None if last is None else hour(last))
        with store.read() as session:
            plans = flown_plans(session, "mini-1", FLOWN, period, limit)
        return [plan.id for plan in plans]

    assert found(2, 6) == over[::-1]
    assert found(2, 6, limit=2) == over[:1:-1]
    assert found(10, None) == over[3:]
