"""What a client does in several requests: make a plan, send it, wait for what a robot says."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from grace_client.exchange import Call, Flow, now_s
from grace_client.generated import models as m

if TYPE_CHECKING:
    from grace_client.calls import AsyncRunner, Runner

V = TypeVar("V", bound=m.PlanView | m.TransferView | m.CommandView | m.MissionView)
WAIT_S = 25.0
PLAN_ENDED = ("done", "failed", "superseded", "cancelled")
MISSION_ENDED = ("done", "failed", "stopped")
COMMAND_SETTLED = ("applied", "refused", "expired")


def next_of(
    runner: "Runner | AsyncRunner", path: str, kind: type[V], seen: str | None, wait_s: float
) -> Flow[tuple[V, str]]:
    """Return a thing once it differs from what was seen, or as it stands after so long.

    ``seen`` is what came with it last time; without it the answer comes at once.
    """
    wait_s = 0.0 if seen is None else max(0.0, min(WAIT_S, wait_s))
    call = Call(
        "GET",
        path,
        query={"wait_s": f"{wait_s:.3f}"},
        headers={} if seen is None else {"If-None-Match": seen},
        timeout_s=wait_s + 30.0,
    )
    answer, found = yield from runner.answered(call, kind)
    return found, answer.headers["ETag"]


def until(
    runner: "Runner | AsyncRunner",
    path: str,
    kind: type[V],
    is_met: Callable[[V], bool],
    timeout_s: float | None,
) -> Flow[V]:
    """Ask for a thing again with each of its changes, until a condition is met.

    Raises:
        TimeoutError: It is not met after so many seconds.
    """
    give_up_s = math.inf if timeout_s is None else now_s() + timeout_s
    found, seen = yield from next_of(runner, path, kind, None, 0.0)
    while not is_met(found):
        left_s = give_up_s - now_s()
        if left_s <= 0.0:
            raise TimeoutError(f"{path} is not as waited for after {timeout_s} s: {_said(found)}")
        found, seen = yield from next_of(runner, path, kind, seen, left_s)
    return found


def _said(found: Any) -> str:  # noqa: ANN401 - any view
    return str(getattr(found, "message", "") or getattr(found, "text", "") or found)


def is_planned(plan: m.PlanView) -> bool:
    """Tell whether a plan is a draft that was flown ahead, or will be none."""
    dry_run = plan.rehearsal
    is_flown = dry_run is None or dry_run.state != "working"
    return plan.state != "planning" and (plan.state != "draft" or is_flown)


def plan(
    runner: "Runner | AsyncRunner",
    path: str,
    body: object,
    timeout_s: float | None,
) -> Flow[m.PlanView]:
    """Ask for a plan and wait until it is a draft that was flown ahead, or will be none."""
    call = Call("POST", path, body=body, takes_key=True)
    started: m.StartedView = yield from runner.told(call, m.StartedView)
    return (yield from until(runner, f"/api/plans/{started.id}", m.PlanView, is_planned, timeout_s))


def send(
    runner: "Runner | AsyncRunner", plan: str, wish: m.UploadRequest, timeout_s: float | None
) -> Flow[m.TransferView]:
    """Send a draft and wait until the robot has proved that it has it, or it is given up."""
    call = Call("POST", f"/api/plans/{plan}/upload", body=wish, takes_key=True, sends="always")
    started: m.StartedView = yield from runner.told(call, m.StartedView)
    path = f"/api/transfers/{started.id}"

    def is_there(transfer: m.TransferView) -> bool:
        wanted = ("running",) if wish.start else ("on_board", "kept")
        return transfer.state in wanted or transfer.ended_at is not None

    return (yield from until(runner, path, m.TransferView, is_there, timeout_s))


def command(
    runner: "Runner | AsyncRunner", robot_path: str, order: m.CommandRequest
) -> Flow[m.CommandView]:
    """Give an order; return as soon as it is written down, and on its way."""
    call = Call("POST", f"{robot_path}/commands", body=order, takes_key=True, sends="by its body")
    started: m.StartedView = yield from runner.told(call, m.StartedView)
    return (yield from runner.told(Call("GET", f"/api/commands/{started.id}"), m.CommandView))
