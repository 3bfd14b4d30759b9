"""What viser's page may load, held against viser's page in a browser."""

from datetime import timedelta

import pytest
import viser
from playwright.async_api import async_playwright

from server.access import register
from server.scene.host import SceneHost
from tests.browser.walk import CHROMIUM, FLAGS
from tests.server.conftest import GRACE, until
from tests.server.station_app import PASSWORD
from webui.scene.page import UNPACKED, policy


def test_the_script_that_the_page_unpacks_is_known():
    assert viser.__version__ in UNPACKED
    assert "'unsafe-inline'" not in policy().partition("style-src")[0]


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")
async def test_the_page_of_a_scene_runs_under_its_policy(client, address, station):
    person = {"name": "ann", "role": "viewer", "password": PASSWORD}
    assert (await client.post("/api/people", json=person)).status_code == 201
    at = station.foundation.clock.now()
    issued = await station.foundation.store.write(
        lambda session: register.create_sign_in_link(
            session, "ann", timedelta(minutes=5), at=at, by="test"
        )
    )
    scene = await station.foundation.services.get(SceneHost).scene(GRACE)
    said: list[str] = []
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=CHROMIUM, args=FLAGS, timeout=120_000
        )
        page = await browser.new_page()
        page.set_default_timeout(120_000)
        page.on("console", lambda message: said.append(message.text))
        await page.goto(f"http://{address}/sign-in?token={issued.secret}")
        await page.goto(f"http://{address}/view/{GRACE}/?framed=true")
        await until(lambda: scene.is_watched, timeout_s=100)
        await browser.close()
    assert not [text for text in said if "Content Security Policy" in text]
