"""A push that reaches the whole station: kept in its inbox, once, whatever it brings."""

from contextlib import asynccontextmanager

from db.query.fleet.robots import add_robot
from db.store import Store
from robot_link.clock import SystemClock
from server.app import create_app
from server.base.secret import GatewayAccount, SecretStore
from server.base.settings import Settings
from server.fleet.disabled_links import DisabledLinks
from server.plan import install as plan
from server.station import Station
from tests.robot_link.signed_push import FORM, IMEI, form_push, public_pem, push_fields
from tests.server.fake_link import World
from tests.server.gateway_station import _tables, blank_database, robot
from tests.server.station_app import client_of, signed_in

__all__ = ["_tables", "blank_database"]


@asynccontextmanager
async def whole_station(folder, monkeypatch):
    """Run every service on a data folder that knows one robot with a RockBLOCK modem."""

    async def stay_cold(*_):
        pass

    monkeypatch.setattr(plan, "warm_up", stay_cold)
    settings = Settings(data_dir=folder, worker_processes=1)
    secrets = SecretStore(settings.secret_dir)
    secrets.set_gateway(
        "rockblock", GatewayAccount(url="https://rockblock.example/MT", public_key=public_pem())
    )
    store = Store.open(settings.resolved_database_url)
    store.change(lambda session: add_robot(session, robot((f"rockblock://{IMEI}",)))).result()
    store.close()
    world = World()
    app = create_app(settings, lambda foundation: Station(foundation, world.make_link))
    async with app.router.lifespan_context(app), client_of(app) as gateway:
        yield app, gateway, f"/api/gateways/rockblock/push/{secrets.push_path('rockblock')}"


async def test_a_robots_push_is_one_line_of_its_satellite_log_however_often_it_comes(
    tmp_path, monkeypatch
):
    now = SystemClock().now()
    fields = push_fields(transmit_time=f"{now:%y-%m-%d %H:%M:%S}")
    async with whole_station(tmp_path, monkeypatch) as (app, gateway, path):
        for is_new in (True, False, False):
            answer = await gateway.post(
                path, content=form_push(fields), headers={"Content-Type": FORM}
            )
            assert (answer.status_code, answer.json()) == (200, {"is_new": is_new})
        async with signed_in(app) as client:
            log = (await client.get("/api/robots/grace-1/satellite")).json()
    (line,) = log["incoming"]
    assert (line["momsn"], line["bytes"], line["is_decoded"]) == (66, 5, False)


async def test_while_its_link_is_unplugged_a_robots_messages_stay_with_the_gateway(
    tmp_path, monkeypatch
):
    async with whole_station(tmp_path, monkeypatch) as (app, gateway, path):
        uri = f"rockblock://{IMEI}"
        links = app.state.foundation.services.get(DisabledLinks)
        await links.set(uri, is_enabled=False, robot="grace-1", by="test")
        assert (await gateway.post(path, content=form_push())).status_code == 503
        await links.set(uri, is_enabled=True, robot="grace-1", by="test")
        assert (await gateway.post(path, content=form_push())).json() == {"is_new": True}
