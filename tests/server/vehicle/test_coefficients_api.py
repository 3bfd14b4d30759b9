"""Coefficients from a table of forces and moments by REST."""

from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.parameter_file import vehicle_document
from server.access.body import BODY_BYTES_MAX
from server.access.role import Role
from tests.server.conftest import api_client
from tests.server.vehicle.test_coefficients import FOUND, csv_text, rows


async def test_a_table_by_rest_becomes_a_vehicle_in_two_steps(client):
    path = "/api/vehicles/miniglider/coefficients"
    by_rows = await client.post(path, json={"rows": rows(), "title": "Of a tunnel"})
    assert by_rows.status_code == 200, by_rows.text
    files = {"file": ("tunnel.csv", csv_text(), "text/csv")}
    data = {"key": "mini-t", "water_density_kg_m3": "1000"}
    by_file = await client.post(path, files=files, data=data)
    assert by_file.status_code == 200, by_file.text
    first, second = by_rows.json(), by_file.json()
    assert first["document"]["key"] == "miniglider-tunnel"
    assert first["document"]["title"] == "Of a tunnel"
    assert second["document"]["key"] == "mini-t"
    names = {one["name"] for one in first["coefficients"]}
    assert names >= FOUND
    assert (await client.get("/api/vehicles/mini-t")).status_code == 404
    added = await client.post("/api/vehicles", json=second["document"])
    assert added.status_code == 201, added.text
    kept = (await client.get("/api/vehicles/mini-t")).json()
    assert kept == second["document"] != vehicle_document(MINIGLIDER)


async def test_a_wrong_table_by_rest_is_refused_at_its_place(client):
    path = "/api/vehicles/miniglider/coefficients"
    wrong = rows()
    wrong[3]["speed_m_s"] = None
    cases = (
        ({"json": {"rows": wrong}}, 422, ["rows", 3, "speed_m_s"]),
        ({"json": {"rows": []}}, 422, ["table"]),
        ({"json": {"rows": rows(), "key": "Bad Key"}}, 422, ["key"]),
        ({"json": {"rows": rows(), "colour": 1}}, 422, ["colour"]),
        ({"content": b"no json"}, 422, []),
        ({"files": {"other": ("t.csv", csv_text(), "text/csv")}}, 422, ["file"]),
        ({"files": {"file": ("t.csv", b"\xff\xfe", "text/csv")}}, 422, ["file"]),
        ({"files": {"file": ("t.csv", "a,b\n1\n", "text/csv")}}, 422, ["line", 2, "b"]),
    )
    for asked, status, loc in cases:
        refused = await client.post(path, **asked)
        assert refused.status_code == status, refused.text
        assert refused.json()["errors"][0]["loc"] == loc, refused.text
    path = "/api/vehicles/shark/coefficients"
    assert (await client.post(path, json={"rows": rows()})).status_code == 404


async def test_a_viewer_fits_nothing(station):
    async with api_client(station, Role.VIEWER) as viewer:
        path = "/api/vehicles/miniglider/coefficients"
        assert (await viewer.post(path, json={"rows": rows()})).status_code == 403


async def test_a_table_may_be_longer_as_a_file_than_as_rows(client):
    path = "/api/vehicles/miniglider/coefficients"
    head, *lines = csv_text().splitlines(keepends=True)
    long = head + "".join(lines) * (BODY_BYTES_MAX // len("".join(lines)) + 1)
    files = {"file": ("tunnel.csv", long, "text/csv")}
    assert (await client.post(path, files=files)).status_code != 413
    for kind in ("application/json", "text/plain"):
        headers = {"Content-Type": kind}
        answer = await client.post(path, content=b" " * (BODY_BYTES_MAX + 1), headers=headers)
        assert answer.status_code == 413
