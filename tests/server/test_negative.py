"""Whatever a program sends, the station answers as its document says, and never with a 500.

Schemathesis draws the requests from the OpenAPI document. The station is a whole one with two
robots; what it would compute waits for ever, so that no request costs more than itself.
"""

import asyncio
import contextlib
import threading
from collections.abc import AsyncGenerator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import schemathesis
import uvicorn
from fastapi import FastAPI
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import negative_data_rejection, positive_data_acceptance
from sqlalchemy.orm import Session

from autonomy.site import TANK
from db.query.robots import add_robot
from server.access.register import create_token
from server.access.role import Role
from server.app import create_app
from server.base.settings import Settings
from server.base.worker import WorkerPool
from server.cli.http_server import HttpServer
from server.station import Station, run_station
from tests.server.conftest import MINI, robot_record, until
from tests.server.fake_link import World

KNOWN = {
    "robot": "mini-1", "plan": "plan-1", "mission": "mission-1", "job": "job-1",
    "variable": "temperature", "whatif": "whatif-1", "identification": "identification-1",
    "transfer": "transfer-1", "command": "command-1", "alarm": "alarm-1",
    "deployment": "deployment-1",
}  # fmt: skip
EXAMPLES = 3


@dataclass
class Served:
    app: FastAPI
    url: str
    secret: str


async def _never(*_: object, **__: object) -> object:
    return await asyncio.Event().wait()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A station in a thread of its own, as a process would be."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(WorkerPool, "run", _never)
        ready, ended, served = threading.Event(), asyncio.Event(), list[Served]()
        loops: list[asyncio.AbstractEventLoop] = []

        async def serve() -> None:
            loops.append(asyncio.get_running_loop())
            async with _serving(tmp_path_factory.mktemp("station")) as one:
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
    settings = Settings(data_dir=folder, simulation=True, worker_processes=1)
    app = create_app(settings)
    async with run_station(settings, lambda base: Station(base, world.make_link)) as running:
        app.state.foundation = running.foundation

        def prepare(session: Session) -> str:
            add_robot(session, robot_record(MINI, 1, "miniglider", TANK))
            hour, now = timedelta(hours=1), datetime.now(UTC)
            return create_token(session, "test", Role.ADMIN, hour, at=now, by="test").secret

        secret = await running.foundation.store.write(prepare)
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
        if operation.tags != [tag] or operation.path == "/api/live":
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
