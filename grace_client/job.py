"""Long work of the station: watched without polling, and its result as the model that it is."""

from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import TypeAdapter

from grace_client.exchange import Call, Flow, now_s
from grace_client.generated.models import JobView
from grace_client.problem import JobFailedError

if TYPE_CHECKING:
    from grace_client.calls import AsyncRunner, Runner

R = TypeVar("R")
WAIT_S = 25.0
"""A request waits so long for news of a job; the station allows 30 s."""
_OPEN = ("queued", "running")


def end_of(runner: "Runner | AsyncRunner", job: str, timeout_s: float | None) -> Flow[JobView]:
    """Wait until a job has ended, over restarts of the station too.

    Raises:
        TimeoutError: It goes on.
    """
    give_up_s = None if timeout_s is None else now_s() + timeout_s
    while True:
        left_s = WAIT_S if give_up_s is None else give_up_s - now_s()
        wait_s = max(0.0, min(WAIT_S, left_s))
        query = {"wait_s": f"{wait_s:.3f}", "until": "end"}
        call = Call("GET", f"/api/jobs/{job}", query=query, timeout_s=wait_s + 30.0)
        view: JobView = yield from runner.told(call, JobView)
        if view.state not in _OPEN:
            return view
        if left_s <= 0.0:
            raise TimeoutError(f"{job} is still {view.state} after {timeout_s:g} s: {view.message}")


def _result(view: JobView, kind: Any) -> Any:  # noqa: ANN401 - a type or a generic
    if view.state != "done":
        raise JobFailedError(view)
    return TypeAdapter(kind).validate_python(view.result)


class Job(Generic[R]):
    """A job that was begun."""

    def __init__(self, runner: "Runner", view: JobView, kind: Any) -> None:  # noqa: ANN401
        self._runner = runner
        self._kind = kind
        self.view = view
        """As it stood when it was asked for last."""

    @property
    def id(self) -> str:
        """Id of the job."""
        return self.view.id

    @property
    def about(self) -> str | None:
        """Id of what it works for, such as a what-if run's."""
        return self.view.about

    def result(self, timeout_s: float | None = None) -> R:
        """Wait for the end and return what the job leaves.

        Raises:
            JobFailedError: It failed, or was cancelled.
            TimeoutError: It goes on after so many seconds.
        """
        self.view = self._runner.run(end_of(self._runner, self.id, timeout_s))
        return _result(self.view, self._kind)

    def refresh(self) -> JobView:
        """Ask how far it is."""
        call = Call("GET", f"/api/jobs/{self.id}")
        self.view = self._runner.run(self._runner.told(call, JobView))
        return self.view

    def cancel(self) -> JobView:
        """Call it off; the answer comes when it has stopped."""
        call = Call("DELETE", f"/api/jobs/{self.id}")
        self.view = self._runner.run(self._runner.told(call, JobView))
        return self.view


class AsyncJob(Generic[R]):
    """A job that was begun; the same as ``Job``, awaited."""

    def __init__(self, runner: "AsyncRunner", view: JobView, kind: Any) -> None:  # noqa: ANN401
        self._runner = runner
        self._kind = kind
        self.view = view

    @property
    def id(self) -> str:
        """Id of the job."""
        return self.view.id

    @property
    def about(self) -> str | None:
        """Id of what it works for, such as a what-if run's."""
        return self.view.about

    async def result(self, timeout_s: float | None = None) -> R:
        """Await the end and return what the job leaves; raises as ``Job.result`` does."""
        self.view = await self._runner.run(end_of(self._runner, self.id, timeout_s))
        return _result(self.view, self._kind)

    async def refresh(self) -> JobView:
        """Ask how far it is."""
        call = Call("GET", f"/api/jobs/{self.id}")
        self.view = await self._runner.run(self._runner.told(call, JobView))
        return self.view

    async def cancel(self) -> JobView:
        """Call it off; the answer comes when it has stopped."""
        call = Call("DELETE", f"/api/jobs/{self.id}")
        self.view = await self._runner.run(self._runner.told(call, JobView))
        return self.view
