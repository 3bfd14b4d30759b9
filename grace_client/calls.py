"""What generated methods stand on, sync and async."""

from collections.abc import Mapping
from typing import Any, Protocol, TypeAlias, TypeVar
from urllib.parse import quote

import httpx

from grace_client.exchange import Call, Flow
from grace_client.generated.models import JobView
from grace_client.job import AsyncJob, Job

T = TypeVar("T")
Upload: TypeAlias = tuple[str, bytes]
"""Name and content of a file."""


class Runner(Protocol):
    """Carries out flows and waits for them."""

    def run(self, flow: Flow[T]) -> T:
        """Return what comes of a flow."""
        ...

    def told(self, call: Call, kind: Any) -> Flow[Any]:  # noqa: ANN401 - a type or a generic
        """Return the flow of a call whose answer is of a kind."""
        ...

    def answered(self, call: Call, kind: Any) -> Flow[tuple[httpx.Response, Any]]:  # noqa: ANN401
        """Return the flow of a call whose answer's head is wanted too."""
        ...


class AsyncRunner(Protocol):
    """Carries out flows without blocking."""

    async def run(self, flow: Flow[T]) -> T:
        """Return what comes of a flow."""
        ...

    def told(self, call: Call, kind: Any) -> Flow[Any]:  # noqa: ANN401 - a type or a generic
        """Return the flow of a call whose answer is of a kind."""
        ...

    def answered(self, call: Call, kind: Any) -> Flow[tuple[httpx.Response, Any]]:  # noqa: ANN401
        """Return the flow of a call whose answer's head is wanted too."""
        ...


def path(template: str, /, **values: str) -> str:
    """Return a path with its values, each as one segment whatever it holds."""
    return template.format(**{name: quote(value, safe="") for name, value in values.items()})


class Calls:
    """Requests that are waited for."""

    def __init__(self, runner: Runner) -> None:
        self._runner = runner

    def _ask(self, call: Call, kind: Any) -> Any:  # noqa: ANN401 - what the method promises
        return self._runner.run(self._runner.told(call, kind))

    def _begin(self, call: Call, result: Any) -> Job[Any]:  # noqa: ANN401
        return Job(self._runner, self._ask(call, JobView), result)

    def _given(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if value is not None}


class AsyncCalls:
    """Requests that are awaited."""

    def __init__(self, runner: AsyncRunner) -> None:
        self._runner = runner

    async def _ask(self, call: Call, kind: Any) -> Any:  # noqa: ANN401 - what the method promises
        return await self._runner.run(self._runner.told(call, kind))

    async def _begin(self, call: Call, result: Any) -> AsyncJob[Any]:  # noqa: ANN401
        return AsyncJob(self._runner, await self._ask(call, JobView), result)

    def _given(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if value is not None}
