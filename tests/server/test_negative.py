"""Whatever a program sends, the station answers as its document says, and never with a 500.

Schemathesis draws the requests from the OpenAPI document. The station is a whole one with two
robots; what it would compute waits for ever, so that no request costs more than itself.
"""

import asyncio
import contextlib
import copy
import shutil
import threading
from collections.abc import AsyncGenerator, Generator, Iterator
from contextlib import ExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import schemathesis
import uvicorn
from fastapi import FastAPI
from hypothesis.stateful import run_state_machine_as_test
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import negative_data_rejection, positive_data_acceptance
from sqlalchemy.orm import Session

from server.access.register import create_token
from server.access.role import Role
from server.app import create_app
from server.base.settings import Settings
from server.base.worker import WorkerPool
from server.cli.http_server import HttpServer
from server.station import Station, run_station
from tests.server.conftest import DATABASE, MINI, until
from tests.server.fake_link import World, current_report, state_report
from tests.server.station_app import AT_WILL

KNOWN = {
    "robot": "mini-1", "plan": "plan-1", "mission": "mission-1", "job": "job-1",
    "variable": "temperature", "whatif": "whatif-1", "identification": "identification-1",
    "transfer": "transfer-1", "command": "command-1", "alarm": "alarm-1",
    "deployment": "deployment-1",
}  # fmt: skip
NOT_ASKED = ("/api/live", "/api/automation")
"""A stream, and the switch that has every later request of a script refused."""
EXAMPLES = 3
SCENARIOS, STEPS = 6, 20
NAMES = {
    ("post", "/api/robots"): ("robot", "id"),
    ("post", "/api/robots/{robot}/plans"): ("plan", "id"),
    ("post", "/api/robots/{robot}/missions"): ("mission", "id"),
    ("post", "/api/robots/{robot}/commands"): ("command", "id"),
    ("post", "/api/robots/{robot}/whatif"): ("whatif", "about"),
    ("post", "/api/robots/{robot}/identifications"): ("identification", "about"),
    ("post", "/api/plans/{plan}/upload"): ("transfer", "id"),
    ("post", "/api/people"): ("name", "name"),
    ("post", "/api/tokens"): ("token", "id"),
    ("get", "/api/jobs"): ("job", "jobs/0/id"),
    ("get", "/api/alarms"): ("alarm", "alarms/0/id"),
    ("get", "/api/deployments"): ("deployment", "deployments/0/id"),
}  # fmt: skip
"""What an answer names: as which part of other paths, and where it stands."""


@dataclass
class Served:
    app: FastAPI
    url: str
    secret: str


async def _never(*_: object, **__: object) -> object:
    return await asyncio.Event().wait()


@pytest.fixture(scope="module")
def served(prepared_database: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WorkerPool, "run", _never)
        with _station(prepared_database, tmp_path_factory.mktemp("station")) as served:
            yield served


@contextmanager
def _station(database: Path, folder: Path) -> Generator[Served]:
    """A station in a thread of its own, as a process would be; it hears mini-1."""
    shutil.copy(database, folder / DATABASE)
    ready, ended, served = threading.Event(), asyncio.Event(), list[Served]()
    loops: list[asyncio.AbstractEventLoop] = []

    async def serve() -> None:
        loops.append(asyncio.get_running_loop())
        async with _serving(folder) as one:
            served.append(one)
            ready.set()
            await ended.wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    try:
        assert ready.wait(100)
        yield served[0]
    finally:
        loops[0].call_soon_threadsafe(ended.set)
        thread.join()


@asynccontextmanager
async def _serving(folder: Path) -> AsyncGenerator[Served]:
    world = World()
    settings = Settings(data_dir=folder, simulation=True, worker_processes=1, **AT_WILL)
    app = create_app(settings)
    async with run_station(settings, lambda base: Station(base, world.make_link)) as running:
        app.state.foundation = running.foundation

        def prepare(session: Session) -> str:
            hour, now = timedelta(hours=1), datetime.now(UTC)
            return create_token(session, "test", Role.ADMIN, hour, at=now, by="test").secret

        secret = await running.foundation.store.write(prepare)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        config = uvicorn.Config(app, port=0, lifespan="off", log_level="error")
        server = HttpServer(config)
        serving = asyncio.create_task(server.serve())
        await until(lambda: server.started)
        port = server.servers[0].sockets[0].getsockname()[1]
        yield Served(app, f"http://127.0.0.1:{port}", secret)
        server.stop()
        await serving
    await world.close()


TAGS = sorted({
    operation["tags"][0]
    for item in create_app(Settings()).openapi()["paths"].values()
    for operation in item.values()
})  # fmt: skip


@pytest.mark.parametrize("mode", GenerationMode)
@pytest.mark.parametrize("tag", TAGS)
def test_every_answer_is_as_documented(served, tag, mode):
    schema = schemathesis.openapi.from_dict(served.app.openapi())
    schema.config.update(base_url=served.url)
    for found in schema.get_all_operations():
        operation = found.ok()
        if operation.tags != [tag] or operation.path in NOT_ASKED:
            continue
        _ask(operation, mode, served)


def _excluded(operation: Any) -> list[schemathesis.CheckFunction]:
    """Return the checks that do not fit: what is well-formed may still make no sense here.

    A moment may also be told in seconds, and what is no word of a form is left out of the form.
    """
    told = str(operation.definition.raw.get("parameters", []))
    is_lenient = operation.path == "/api/imports" or "date-time" in told
    return [positive_data_acceptance, *([negative_data_rejection] if is_lenient else [])]


def _ask(operation: Any, mode: GenerationMode, served: Served) -> None:
    @hypothesis.settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(operation.as_strategy(generation_mode=mode))
    def ask(case: schemathesis.Case) -> None:
        for name in KNOWN.keys() & (case.path_parameters or {}).keys():
            case.path_parameters[name] = KNOWN[name]
        headers = {"Authorization": f"Bearer {served.secret}"}
        case.call_and_validate(headers=headers, excluded_checks=_excluded(operation), timeout=60)

    with contextlib.suppress(hypothesis.errors.Unsatisfiable):  # nothing of it can be wrong
        ask()


def _linked(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document that tells what can be done next with what an answer names."""
    linked = copy.deepcopy(document)
    for (method, path), (kind, place) in NAMES.items():
        responses = linked["paths"][path][method]["responses"]
        [good] = [told for status, told in responses.items() if status.startswith("2")]
        good["links"] = {
            operation["operationId"]: {
                "operationId": operation["operationId"],
                "parameters": {kind: f"$response.body#/{place}"},
            }
            for other, item in linked["paths"].items()
            for operation in item.values()
            if f"{{{kind}}}" in other
        }
    return linked


@pytest.mark.timeout(900)
def test_whatever_is_asked_one_after_the_other_is_answered_as_documented(
    prepared_database, tmp_path_factory, monkeypatch
):
    """What one request made the next ones use, in an order that nobody thought of.

    Each scenario has a station of its own, so that a seed always tells the same one.
    """
    monkeypatch.setattr(WorkerPool, "run", _never)
    schema = schemathesis.openapi.from_dict(_linked(create_app(Settings()).openapi()))
    schema.config.phases.stateful.inference.algorithms = []
    schema = schema.exclude(path=list(NOT_ASKED))

    class Stranger(schema.as_state_machine()):  # type: ignore[misc]
        def setup(self) -> None:
            self.opened, self.made = ExitStack(), []
            folder = tmp_path_factory.mktemp("station")
            self.served = self.opened.enter_context(_station(prepared_database, folder))

        def teardown(self) -> None:
            self.opened.close()

        def before_call(self, case: schemathesis.Case) -> None:
            """Ask of the known robot, unless another was named by an answer."""
            parts = case.path_parameters or {}
            named = {told.json().get("id") for told in self.made if told.status_code == 201}
            if parts.get("robot", MINI) not in named:
                parts.update({name: KNOWN[name] for name in parts.keys() & {"robot", "variable"}})

        def after_call(self, response: Any, case: schemathesis.Case) -> None:
            super().after_call(response, case)
            if case.operation.label == "POST /api/robots":
                self.made.append(response)

        def get_call_kwargs(self, case: schemathesis.Case) -> dict[str, Any]:
            headers = {"Authorization": f"Bearer {self.served.secret}"}
            return {"base_url": self.served.url, "headers": headers, "timeout": 60}

        def validate_response(self, response: Any, case: schemathesis.Case, **more: Any) -> None:
            case.validate_response(
                response,
                excluded_checks=_excluded(case.operation),
                transport_kwargs=more,
                recorder=self.recorder,
            )

    run_state_machine_as_test(
        Stranger,
        settings=hypothesis.settings(
            max_examples=SCENARIOS,
            stateful_step_count=STEPS,
            deadline=None,
            database=None,
            derandomize=True,
            phases=[hypothesis.Phase.generate],
            suppress_health_check=list(hypothesis.HealthCheck),
        ),
    )
