import re

from tests.server.station_app import client_of, running


async def test_the_interface_is_described_without_anything_from_elsewhere(tmp_path):
    async with running(tmp_path) as app, client_of(app) as client:
        page = await client.get("/docs")
        openapi = (await client.get("/openapi.json")).json()
    assert page.status_code == 200
    for path in openapi["paths"]:
        assert f"<code>{path}</code>" in page.text
    assert "<script" not in page.text
    links = re.findall(r"(?:href|src)='?([^'> ]+)", page.text)
    assert links
    assert all(link.startswith(("#", "/")) for link in links)
    shapes = {link[1:] for link in links if link.startswith("#")}
    assert shapes <= set(re.findall(r"id='([^']+)'", page.text))


async def test_every_operation_has_a_sentence_and_refusals_have_a_shape(tmp_path):
    async with running(tmp_path) as app, client_of(app) as client:
        openapi = (await client.get("/openapi.json")).json()
    for item in openapi["paths"].values():
        for operation in item.values():
            assert operation["description"].endswith((".", ".\n"))
            assert "ProblemDetails" in str(operation["responses"]["4XX"])


async def test_a_simulation_is_marked_on_this_page_too(tmp_path):
    for simulation in (True, False):
        async with (
            running(tmp_path / str(simulation), simulation=simulation) as app,
            client_of(app) as client,
        ):
            page = (await client.get("/docs")).text
        assert ("SIMULATION" in page) is simulation
        assert "``" not in page
