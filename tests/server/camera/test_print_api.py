"""Plates and the board by REST: true to the printed ones, refused in words, nothing needed."""

import re

import numpy as np
import pytest

from robot_link.camera import extra
from robot_link.camera.printed.sheet import tag_cells


async def test_a_tag_for_a_screen_has_the_cells_of_the_printed_one(client):
    answer = await client.get("/api/tags/205.svg")
    assert answer.headers["Content-Type"] == "image/svg+xml"
    black = re.findall(r"M(\d+) (\d+)h1v1h-1z", answer.text)
    shown = np.zeros((8, 8), dtype=bool)
    for column, row in black:
        shown[int(row) - 1, int(column) - 1] = True
    assert np.array_equal(shown, tag_cells(205))


async def test_sheets_and_the_board_are_pdf(client):
    sheets = await client.get("/api/tags/sheets.pdf", params={"ids": "0-2,100", "size_m": 0.1})
    board = await client.get("/api/tags/board.pdf")
    for answer in (sheets, board):
        assert answer.headers["Content-Type"] == "application/pdf"
        assert answer.content.startswith(b"%PDF")
    assert b"id 100" in sheets.content


@pytest.mark.parametrize(
    ("ids", "size_m", "field"), [("0-", 0.1, "ids"), ("99", 0.1, "ids"), ("0", 9.0, "size_m")]
)
async def test_what_cannot_be_printed_is_named(client, ids, size_m, field):
    answer = await client.get("/api/tags/sheets.pdf", params={"ids": ids, "size_m": size_m})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["query", field]


async def test_a_tag_of_nobody_is_no_picture(client):
    assert (await client.get("/api/tags/99.svg")).status_code == 404


async def test_without_the_extra_the_station_says_what_to_install(client, monkeypatch):
    def missing(_name: str) -> None:
        return None

    monkeypatch.setattr(extra, "find_spec", missing)
    answer = await client.get("/api/tags/board.pdf")
    assert answer.status_code == 503
    assert "install the extra camera" in answer.json()["detail"]
