"""A station whose services are its gateways and an inbox, and no more."""

import shutil
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest
from fastapi import FastAPI
from sqlalchemy.orm import Session

from autonomy.site import LAKE
from db.query.fleet.robots import RobotRecord
from db.query.satellite.inbox import add_inbox
from db.store import Store
from robot_link.messages import RobotId, SystemId
from robot_link.station.gateway.gateway import MobileOriginated
from server.app import create_app
from server.base.foundation import Foundation
from server.base.secret import GatewayAccount
from server.base.settings import Settings
from server.satellite.gateways import Gateways
from tests.robot_link.signed_push import public_pem

PASSWORD = "s3cret-word"


class Keeper:
    """Stands where the station's services are: keeps messages in the inbox, and no more."""

    def __init__(self, foundation: Foundation) -> None:
        self._store = foundation.store
        self.fault: Exception | None = None
        self.messages: list[MobileOriginated] = []
        self.gateways = foundation.services.add(Gateways(foundation, self.take))
        foundation.services.add(self)

    async def start(self) -> None:
        await self.gateways.start()

    async def stop(self) -> None:
        await self.gateways.stop()

    async def take(self, message: MobileOriginated) -> bool:
        if self.fault is not None:
            raise self.fault

        def kept(session: Session) -> bool:
            return add_inbox(session, message, None)[1]

        is_new = await self._store.write(kept)
        self.messages.append(message)
        return is_new


@pytest.fixture(scope="session")
def blank_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with its tables and nothing in it, made once: that takes its time."""
    folder = tmp_path_factory.mktemp("blank")
    Store.open(Settings(data_dir=folder).resolved_database_url).close()
    return folder / "station.sqlite3"


@pytest.fixture(autouse=True)
def _tables(blank_database: Path, tmp_path: Path) -> None:
    shutil.copy(blank_database, tmp_path / blank_database.name)


def keeper_of(app: FastAPI) -> Keeper:
    """Return what stands where the station's services are."""
    return app.state.foundation.services.get(Keeper)


@asynccontextmanager
async def station(folder: Path, **settings: object) -> AsyncGenerator[FastAPI, None]:
    app = create_app(Settings.model_validate({"data_dir": folder, **settings}), Keeper)
    async with app.router.lifespan_context(app):
        account = GatewayAccount(
            url="https://rockblock.example/MT",
            username="ann",
            password=PASSWORD,
            public_key=public_pem(),
        )
        app.state.foundation.secrets.set_gateway("rockblock", account)
        yield app


def robot(links: tuple[str, ...]) -> RobotRecord:
    return RobotRecord(
        id=RobotId("grace-1"),
        name="grace-1",
        model="grace3",
        kind="real",
        system_id=SystemId(2),
        links=links,
        site=LAKE,
        created_at=datetime.now(UTC),
    )
