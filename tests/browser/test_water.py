"""A water of one's own, made in the browser: from a file, from a grid, and by hand."""

import json
import re

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.browser.walk import browser_page, open_page
from tests.e2e.demo import Demo

pytestmark = [pytest.mark.browser, pytest.mark.walk]

WEST, SOUTH, EAST, NORTH = -84.40, 42.70, -84.38, 42.715


def bay() -> str:
    corners = [[WEST, SOUTH], [EAST, SOUTH], [EAST, NORTH], [-84.392, 42.712], [WEST, NORTH]]
    shore = {
        "type": "Feature",
        "properties": {"name": "Otter Bay"},
        "geometry": {"type": "Polygon", "coordinates": [[*corners, corners[0]]]},
    }
    return json.dumps({"type": "FeatureCollection", "features": [shore]})


def soundings() -> str:
    lines = [
        f"{x:.4f} {y:.4f} {20.0 - 4000.0 * (y - SOUTH) ** 2 * 20.0:.2f}"
        for y in np.linspace(SOUTH, NORTH, 31)
        for x in np.linspace(WEST, EAST, 41)
    ]
    return "\n".join(lines)


def test_a_bay_is_made_from_an_outline_and_a_grid_and_given_a_dock(browser, tmp_path):
    shore, grid = tmp_path / "otter-bay.geojson", tmp_path / "soundings.xyz"
    shore.write_text(bay())
    grid.write_text(soundings())
    with (
        Demo(tmp_path / "data", "--speed", "5") as demo,
        browser_page(browser, demo) as page,
    ):
        open_page(page, demo, "/settings")
        page.get_by_role("button", name="Add a water").click()
        editor = page.get_by_role("region", name="Add a water")
        editor.locator("input[type=file]").set_input_files(shore)
        found = editor.get_by_role("region", name="Read from otter-bay.geojson")
        expect(found.get_by_label("Use of Otter Bay")).to_have_value("outline")
        editor.locator("input[type=file]").set_input_files(grid)
        depths = editor.get_by_role("region", name="Read from soundings.xyz")
        expect(depths).to_contain_text("41")
        editor.get_by_label("Name", exact=True).first.fill("Otter Bay")
        editor.get_by_role("button", name="Add Otter Bay").click()

        waters = page.get_by_role("region", name="Waters")
        expect(waters).to_contain_text("Otter Bay")
        waters.get_by_role("button", name="Change Otter Bay").click()
        editor = page.get_by_role("region", name="Change Otter Bay")
        editor.get_by_text("Docks, beacons, receivers").click()
        editor.get_by_role("button", name="Add a place").click()
        editor.get_by_label("Position", exact=True).fill("42 42.6 N 84 23.4 W")
        editor.get_by_role("button", name="Save Otter Bay").click()
        expect(waters).to_contain_text("Otter Bay")

        open_page(page, demo, "/settings")
        waters.get_by_role("button", name="Change Otter Bay").click()
        position = page.get_by_label("Position", exact=True)
        expect(position).to_have_value(re.compile(r"42\.71000° N 084\.39000° W"))
