"""The station as a script meets it: ``Station``, and ``AsyncStation``, which is awaited."""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

import httpx
from pydantic import TypeAdapter, ValidationError

from grace_client import flow as flows
from grace_client.calls import path
from grace_client.event_cursor import AsyncEventCursor, EventCursor
from grace_client.exchange import Call, Flow, Patience, Pause, Reply, as_json, exchange, now_s
from grace_client.exchange import refuse_to_send as refuse
from grace_client.generated import STATION_VERSION
from grace_client.generated import models as m
from grace_client.generated.operations import AsyncGroups, Groups
from grace_client.problem import VersionError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

T = TypeVar("T")
Legs = Sequence[m.LegBody | Mapping[str, Any]]
Order = Literal["hold", "resume", "quiet", "ping", "arm", "disarm", "zero_depth"]
_ADAPTERS: dict[str, TypeAdapter[Any]] = {}


@dataclass
class _Manner:
    """How a client asks; it does no I/O."""

    url: str
    token: str
    may_send: bool
    patience: Patience
    timeout_s: float
    any_version: bool
    is_known: bool = field(default=False, init=False)

    def told(self, call: Call, kind: Any) -> Flow[Any]:  # noqa: ANN401 - a type or a generic
        """Return what a call is answered, as what it is to be."""
        _, found = yield from self.answered(call, kind)
        return found

    def answered(self, call: Call, kind: Any) -> Flow[tuple[httpx.Response, Any]]:  # noqa: ANN401
        """Return an answer too, beside what it says."""
        if not self.may_send:
            refuse(call)
        if not self.is_known:
            yield from self._get_to_know()
        answer = yield from exchange(call, self.patience)
        return answer, self._read(answer, kind)

    def _get_to_know(self) -> Flow[None]:
        answer = yield from exchange(Call("GET", "/api/health"), self.patience)
        version = str(answer.json().get("version", "unknown"))
        if not self.any_version and _release(version) != _release(STATION_VERSION):
            raise VersionError(_mismatch(self.url, version))
        self.is_known = True

    def _read(self, answer: httpx.Response, kind: Any) -> Any:  # noqa: ANN401
        if kind is None:
            return None
        if kind is bytes:
            return answer.content
        key = repr(kind)
        if key not in _ADAPTERS:
            _ADAPTERS[key] = TypeAdapter(kind)
        try:
            return _ADAPTERS[key].validate_json(answer.content)
        except ValidationError as error:
            where = f"{answer.request.method} {answer.request.url.path}"
            raise VersionError(
                f"The answer to {where} is not what this client, made for station "
                f"{STATION_VERSION}, knows; install the client of the station at {self.url}.\n"
                f"{error}"
            ) from error

    def request_of(self, client: httpx.Client | httpx.AsyncClient, call: Call) -> httpx.Request:
        """Return a call as it goes out."""
        body = as_json(call.body)
        return client.build_request(
            call.method,
            call.path,
            params={name: _query_value(value) for name, value in call.query.items()} or None,
            json=body if body is not None else None,
            files=list(call.files) or None,
            data={name: _query_value(value) for name, value in call.form.items()} or None,
            headers={name: str(value) for name, value in call.headers.items()},
            timeout=call.timeout_s or self.timeout_s,
        )

    @property
    def headers(self) -> dict[str, str]:
        """What every request carries."""
        return {"Authorization": f"Bearer {self.token}"}


class Station:
    """A station, by its address and a token (*Settings*, *Scripts*, or ``grace token create``).

    It sends no robot anything unless ``may_send``: plans, checks, dry runs and drafts do no more
    than a person who looks ahead. *Surface now* is always allowed.

    Args:
        url: Address, such as ``https://station.example.org``.
        token: What proves who asks.
        may_send: Whether robots may be sent plans, settings and orders.
        patience: How long to try where that changes nothing twice.
        timeout_s: How long one answer may take.
        any_version: Whether to talk with a station of another release too.
        transport: Carries the requests, in place of the network.
        verify: Certificates to trust, as ``httpx`` takes them.
    """

    def __init__(
        self,
        url: str,
        token: str,
        *,
        may_send: bool = False,
        patience: Patience = Patience(),  # noqa: B008 - frozen
        timeout_s: float = 30.0,
        any_version: bool = False,
        transport: httpx.BaseTransport | None = None,
        verify: Any = True,  # noqa: ANN401 - as httpx takes it
    ) -> None:
        self._manner = _Manner(url, token, may_send, patience, timeout_s, any_version)
        self._http = httpx.Client(
            base_url=url, headers=self._manner.headers, transport=transport, verify=verify
        )
        self.ask = Groups(self)
        """Every request that the station takes, by its own name."""

    def __enter__(self) -> Self:
        """Return the client itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of the connections."""
        self.close()

    def close(self) -> None:
        """Let go of the connections."""
        self._http.close()

    def told(self, call: Call, kind: Any) -> Flow[Any]:  # noqa: ANN401 - a type or a generic
        """Return the flow of a call whose answer is of a kind."""
        return self._manner.told(call, kind)

    def answered(self, call: Call, kind: Any) -> Flow[tuple[httpx.Response, Any]]:  # noqa: ANN401
        """Return the flow of a call whose answer's head is wanted too."""
        return self._manner.answered(call, kind)

    def run(self, flow: Flow[T]) -> T:
        """Carry out a flow."""
        reply: Reply = None
        while True:
            try:
                step = flow.send(reply)
            except StopIteration as end:
                return end.value
            if isinstance(step, Pause):
                time.sleep(step.seconds)
                reply = None
                continue
            try:
                reply = self._http.send(self._manner.request_of(self._http, step))
            except httpx.TransportError as error:
                reply = error

    def plan(
        self,
        robot: str,
        wanted: m.SurveyPlanRequest | m.PrimitivesPlanRequest | m.TargetPlanRequest | Legs,
        *,
        timeout_s: float | None = None,
    ) -> m.PlanView:
        """Make a plan and wait until it is a draft that was flown ahead; nothing is sent.

        Look at ``state``: one that could not be made is ``failed``, and ``message`` says why;
        ``violations`` are the limits that a draft breaks.

        Args:
            robot: Id of the robot.
            wanted: What is wanted of the plan; of legs, these as they are.
            timeout_s: How long to wait at most.

        Raises:
            InvalidError: It names each field that is wrong.
            TimeoutError: The station still plans.
        """
        return self.run(flows.plan(self, *_plan_request(robot, wanted), timeout_s))

    def send(
        self,
        plan: str,
        *,
        start: bool = False,
        timeout_s: float | None = None,
        **wish: Any,  # noqa: ANN401 - fields of UploadRequest
    ) -> m.TransferView:
        """Send a draft, and wait until the robot has proved that it has it, or flies it.

        Raises:
            NotSentError: The client may not send.
            ConflictError: It breaks limits, is outdated, or somebody else is in charge.
            TimeoutError: It is still on its way.
        """
        return self.run(flows.send(self, plan, _wish(start, wish), timeout_s))

    def wait_for_plan(self, plan: str, *states: str, timeout_s: float | None = None) -> m.PlanView:
        """Wait until a plan is in one of some states, or has ended."""
        wanted = (*states, *flows.PLAN_ENDED)
        return self.run(
            flows.until(
                self, path("/api/plans/{plan}", plan=plan), m.PlanView,
                lambda one: one.state in wanted, timeout_s,
            )
        )  # fmt: skip

    def wait_until_planned(self, plan: str, *, timeout_s: float | None = None) -> m.PlanView:
        """Wait until a plan is a draft that was flown ahead, or will be none."""
        where = path("/api/plans/{plan}", plan=plan)
        return self.run(flows.until(self, where, m.PlanView, flows.is_planned, timeout_s))

    def wait_for_mission(
        self, mission: str, *states: str, timeout_s: float | None = None
    ) -> m.MissionView:
        """Wait until a mission is in one of some states, or has ended."""
        where = path("/api/missions/{mission}", mission=mission)
        wanted = (*states, *flows.MISSION_ENDED)
        return self.run(
            flows.until(self, where, m.MissionView, lambda one: one.state in wanted, timeout_s)
        )

    def changes_of_mission(
        self, mission: str, *, timeout_s: float = math.inf
    ) -> Iterator[m.MissionView]:
        """Yield a mission now and with each of its changes, until the time is over."""
        where, seen = path("/api/missions/{mission}", mission=mission), None
        give_up_s = now_s() + timeout_s
        while (left_s := give_up_s - now_s()) > 0.0:
            flow = flows.next_of(self, where, m.MissionView, seen, left_s)
            found, seen = self.run(flow)
            yield found

    def surface_now(self, robot: str) -> m.CommandView:
        """Bring a robot up, by every link that it has; it ends what the robot does.

        It is allowed to every pilot at any time, and to every client.
        """
        return self.run(flows.command(self, _robot(robot), m.CommandRequest(kind="surface")))

    def command(self, robot: str, kind: Order) -> m.CommandView:
        """Give a robot an order; ``wait_for_command`` tells how it was answered."""
        return self.run(flows.command(self, _robot(robot), m.CommandRequest(kind=kind)))

    def wait_for_command(self, command: str, *, timeout_s: float | None = None) -> m.CommandView:
        """Wait until the robot has answered an order, or it has expired."""
        return self.run(
            flows.until(
                self, path("/api/commands/{command}", command=command), m.CommandView,
                lambda one: one.level in flows.COMMAND_SETTLED, timeout_s,
            )
        )  # fmt: skip

    def events(
        self,
        *kind: str,
        robot: str | None = None,
        file: str | None = None,
        after: int | None = None,
    ) -> EventCursor:
        """Return the events from now on, each once, over restarts of station and script.

        Args:
            kind: Kinds that are wanted, such as ``robot.surfaced``; all without one.
            robot: Whose are wanted.
            file: Keeps the place in the log; a script that begins again goes on there.
            after: Cursor to go on after.
        """
        return EventCursor(self, robot, kind, file, after)

    def samples(self, robot: str, channel: str, **more: Any) -> "pd.DataFrame":  # noqa: ANN401
        """Return the history of a channel, with its unit in ``attrs``; needs pandas."""
        from grace_client import table

        return table.samples(self.ask.robots.get_samples(robot, channel, **more))

    def track(self, robot: str, **more: Any) -> "pd.DataFrame":  # noqa: ANN401
        """Return where a robot believed to be, with units in ``attrs``; needs pandas."""
        from grace_client import table

        return table.track(self.ask.robots.get_track(robot, **more))

    def map(self, robot: str, variable: str, **more: Any) -> "xr.Dataset":  # noqa: ANN401
        """Return a field map: mean and standard deviation on its grid; needs xarray."""
        from grace_client import table

        return table.field_map(self.ask.maps.get_map(robot, variable, **more))


class AsyncStation:
    """The same as ``Station``, awaited."""

    def __init__(
        self,
        url: str,
        token: str,
        *,
        may_send: bool = False,
        patience: Patience = Patience(),  # noqa: B008 - frozen
        timeout_s: float = 30.0,
        any_version: bool = False,
        transport: httpx.AsyncBaseTransport | None = None,
        verify: Any = True,  # noqa: ANN401 - as httpx takes it
    ) -> None:
        self._manner = _Manner(url, token, may_send, patience, timeout_s, any_version)
        self._http = httpx.AsyncClient(
            base_url=url, headers=self._manner.headers, transport=transport, verify=verify
        )
        self.ask = AsyncGroups(self)
        """Every request that the station takes, by its own name."""

    async def __aenter__(self) -> Self:
        """Return the client itself."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Let go of the connections."""
        await self.aclose()

    async def aclose(self) -> None:
        """Let go of the connections."""
        await self._http.aclose()

    def told(self, call: Call, kind: Any) -> Flow[Any]:  # noqa: ANN401 - a type or a generic
        """Return the flow of a call whose answer is of a kind."""
        return self._manner.told(call, kind)

    def answered(self, call: Call, kind: Any) -> Flow[tuple[httpx.Response, Any]]:  # noqa: ANN401
        """Return the flow of a call whose answer's head is wanted too."""
        return self._manner.answered(call, kind)

    async def run(self, flow: Flow[T]) -> T:
        """Carry out a flow."""
        reply: Reply = None
        while True:
            try:
                step = flow.send(reply)
            except StopIteration as end:
                return end.value
            if isinstance(step, Pause):
                await asyncio.sleep(step.seconds)
                reply = None
                continue
            try:
                reply = await self._http.send(self._manner.request_of(self._http, step))
            except httpx.TransportError as error:
                reply = error

    async def plan(
        self,
        robot: str,
        wanted: m.SurveyPlanRequest | m.PrimitivesPlanRequest | m.TargetPlanRequest | Legs,
        *,
        timeout_s: float | None = None,
    ) -> m.PlanView:
        """Make a plan, as ``Station.plan`` does."""
        return await self.run(flows.plan(self, *_plan_request(robot, wanted), timeout_s))

    async def send(
        self,
        plan: str,
        *,
        start: bool = False,
        timeout_s: float | None = None,
        **wish: Any,  # noqa: ANN401 - fields of UploadRequest
    ) -> m.TransferView:
        """Send a draft, as ``Station.send`` does."""
        return await self.run(flows.send(self, plan, _wish(start, wish), timeout_s))

    async def wait_for_plan(
        self, plan: str, *states: str, timeout_s: float | None = None
    ) -> m.PlanView:
        """Wait until a plan is in one of some states, or has ended."""
        wanted = (*states, *flows.PLAN_ENDED)
        return await self.run(
            flows.until(
                self, path("/api/plans/{plan}", plan=plan), m.PlanView,
                lambda one: one.state in wanted, timeout_s,
            )
        )  # fmt: skip

    async def wait_until_planned(self, plan: str, *, timeout_s: float | None = None) -> m.PlanView:
        """Wait until a plan is a draft that was flown ahead, or will be none."""
        where = path("/api/plans/{plan}", plan=plan)
        return await self.run(flows.until(self, where, m.PlanView, flows.is_planned, timeout_s))

    async def wait_for_mission(
        self, mission: str, *states: str, timeout_s: float | None = None
    ) -> m.MissionView:
        """Wait until a mission is in one of some states, or has ended."""
        where = path("/api/missions/{mission}", mission=mission)
        wanted = (*states, *flows.MISSION_ENDED)
        return await self.run(
            flows.until(self, where, m.MissionView, lambda one: one.state in wanted, timeout_s)
        )

    async def changes_of_mission(
        self, mission: str, *, timeout_s: float = math.inf
    ) -> AsyncIterator[m.MissionView]:
        """Yield a mission now and with each of its changes, until the time is over."""
        where, seen = path("/api/missions/{mission}", mission=mission), None
        give_up_s = now_s() + timeout_s
        while (left_s := give_up_s - now_s()) > 0.0:
            flow = flows.next_of(self, where, m.MissionView, seen, left_s)
            found, seen = await self.run(flow)
            yield found

    async def surface_now(self, robot: str) -> m.CommandView:
        """Bring a robot up, as ``Station.surface_now`` does."""
        return await self.run(flows.command(self, _robot(robot), m.CommandRequest(kind="surface")))

    async def command(self, robot: str, kind: Order) -> m.CommandView:
        """Give a robot an order."""
        return await self.run(flows.command(self, _robot(robot), m.CommandRequest(kind=kind)))

    async def wait_for_command(
        self, command: str, *, timeout_s: float | None = None
    ) -> m.CommandView:
        """Wait until the robot has answered an order, or it has expired."""
        return await self.run(
            flows.until(
                self, path("/api/commands/{command}", command=command), m.CommandView,
                lambda one: one.level in flows.COMMAND_SETTLED, timeout_s,
            )
        )  # fmt: skip

    def events(
        self,
        *kind: str,
        robot: str | None = None,
        file: str | None = None,
        after: int | None = None,
    ) -> AsyncEventCursor:
        """Return the events from now on, as ``Station.events`` does."""
        return AsyncEventCursor(self, robot, kind, file, after)

    async def samples(self, robot: str, channel: str, **more: Any) -> "pd.DataFrame":  # noqa: ANN401
        """Return the history of a channel, with its unit in ``attrs``; needs pandas."""
        from grace_client import table

        return table.samples(await self.ask.robots.get_samples(robot, channel, **more))

    async def track(self, robot: str, **more: Any) -> "pd.DataFrame":  # noqa: ANN401
        """Return where a robot believed to be, with units in ``attrs``; needs pandas."""
        from grace_client import table

        return table.track(await self.ask.robots.get_track(robot, **more))

    async def map(self, robot: str, variable: str, **more: Any) -> "xr.Dataset":  # noqa: ANN401
        """Return a field map: mean and standard deviation on its grid; needs xarray."""
        from grace_client import table

        return table.field_map(await self.ask.maps.get_map(robot, variable, **more))


def _release(version: str) -> tuple[str, ...]:
    return tuple(version.split(".")[:2])


def _mismatch(url: str, version: str) -> str:
    return (
        f"The station at {url} is {version}, and this client was made for {STATION_VERSION}; "
        "install the client of that release (or any_version=True, to try)."
    )


def _query_value(value: object) -> Any:  # noqa: ANN401 - what httpx takes
    if isinstance(value, datetime):
        return value.isoformat()
    return value


def _robot(robot: str) -> str:
    return path("/api/robots/{robot}", robot=robot)


def _wish(start: bool, wish: Mapping[str, Any]) -> m.UploadRequest:
    return m.UploadRequest(start=start, **wish)


def _plan_request(robot: str, wanted: Any) -> tuple[str, object]:  # noqa: ANN401
    if isinstance(wanted, list | tuple):
        legs = [as_json(leg) for leg in wanted]
        wanted = {"kind": "primitives", "legs": legs}
    return f"{_robot(robot)}/plans", wanted
