"""A data manager hands a deployment over: ended, flagged, reviewed, packed, opened again."""

import csv
import io
import re
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.browser.test_lost import vees
from tests.browser.walk import CHROMIUM, SHOTS, browser_page, open_page
from tests.e2e.demo import LASTING, Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(900),
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
]
ROBOT = "grace-1"
SAMPLES = 60
CHANNEL = "temperature"


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    with Demo(tmp_path_factory.mktemp("lake"), "--robots", ROBOT, "--speed", "20") as demo:
        yield demo


@pytest.fixture(scope="module")
def sheet(browser, lake):
    with browser_page(browser, lake) as page:
        cookies = {one["name"]: one["value"] for one in page.context.cookies()}
        lake.client.cookies.update(cookies)
        lake.client.headers["X-CSRF-Token"] = lake.get("/api/session")["csrf_token"]
        yield page


def deployment(lake):
    return lake.get("/api/deployments", robot=ROBOT)["deployments"][-1]


def test_a_survey_is_ended_flagged_reviewed_packed_and_opened_elsewhere(
    browser, sheet, lake, tmp_path
):
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    fly(lake)
    lake.wait("measuring", lambda: deployment(lake)["samples"] >= SAMPLES, 120.0)
    name = deployment(lake)["name"]
    open_page(sheet, lake, f"/robot/{ROBOT}")
    line = sheet.get_by_role("region", name=f"Deployment of {ROBOT}")
    line.get_by_role("button", name="End the deployment").click()
    line.get_by_role("button", name=re.compile("^End .* now$")).click()
    expect(line.get_by_role("heading", name="In the workshop")).to_be_visible()

    open_page(sheet, lake, f"/data/{ROBOT}")
    sheet.get_by_role("region", name="Deployments").get_by_role("link", name=name).click()
    quality = sheet.get_by_role("region", name="Quality")
    quality.get_by_role("button", name="Check the data").click()
    expect(quality.get_by_text("grace-qartod")).to_be_visible()
    first, last = flag_the_second_quarter(lake, quality)

    packing = sheet.get_by_role("region", name="Delivery")
    expect(packing.get_by_text("The metadata lack")).to_be_visible()
    fill_in(sheet, packing)
    expect(packing.get_by_text("The metadata lack")).to_have_count(0)
    sheet.get_by_role("button", name="Review", exact=True).click()
    sheet.get_by_role("button", name=re.compile("^(Sign|Review)")).last.click()
    packing.get_by_label("No better data exist").check()
    packing.get_by_role("button", name="Pack the delivery").click()
    link = packing.get_by_role("link", name=re.compile(r"\.zip$"))
    expect(link).to_be_visible(timeout=400_000)
    expect(packing.get_by_text("OG1.0: passed")).to_be_visible()
    expect(packing.get_by_text("CF-1.10: passed")).to_be_visible()
    sheet.screenshot(path=SHOTS / "delivery.png", full_page=True)

    with sheet.expect_download() as loaded:
        link.click()
    loaded.value.save_as(tmp_path / "delivery.zip")
    with zipfile.ZipFile(tmp_path / "delivery.zip") as archive:
        archive.extractall(tmp_path)
    (top,) = [one for one in tmp_path.iterdir() if one.is_dir()]
    rows = table(top / "data/csv/samples.csv")
    with xarray.open_dataset(top / "data/netcdf" / f"{top.name}.nc") as data:
        assert_equal(data, rows, first, last)
    report = browser.new_page()
    report.goto((top / "data/report/report.html").as_uri())
    expect(report.get_by_text("The file passes every check.")).to_be_visible()
    expect(report.get_by_text("A fish lay on the lens.")).to_be_visible()
    report.screenshot(path=SHOTS / "delivery-report.png", full_page=True)
    report.close()


def fly(lake):
    """Fly two glides down and up, to the end."""
    lake.wait("a place", lambda: lake.get(f"/api/robots/{ROBOT}/state")["position"], 60.0)
    lake.patch("/api/config/planner", LASTING, robot=ROBOT)
    body = {"kind": "primitives", "legs": vees(lake)[:4], "config": {"max_uncertainty_m": 60.0}}
    plan = lake.post(f"/api/robots/{ROBOT}/plans", body)["id"]
    lake.wait("a draft", lambda: lake.get(f"/api/plans/{plan}")["state"] == "draft", 120.0)
    lake.post(f"/api/plans/{plan}/upload", {"start": True})
    lake.wait("its end", lambda: lake.get(f"/api/plans/{plan}")["state"] == "done", 300.0)


def flag_the_second_quarter(lake, quality):
    """Flag the second quarter of what was sampled of the channel; return its ends."""
    told = lake.get(f"/api/robots/{ROBOT}/samples", channel=CHANNEL)["measured_at"]
    times = [datetime.fromisoformat(one) for one in told]
    ends = times[len(times) // 4], times[len(times) // 2]
    first, last = (one.replace(microsecond=0) for one in ends)
    quality.get_by_role("button", name="Flag a stretch").click()
    quality.get_by_label("Series").select_option(CHANNEL)
    for label, at in (("From, UTC", first), ("To, UTC", last)):
        quality.get_by_label(label).fill(f"{at:%Y-%m-%d %H:%M:%S}")
    quality.get_by_label("Reason").fill("A fish lay on the lens.")
    quality.get_by_role("button", name="Set the flag").click()
    expect(quality.get_by_text("A fish lay on the lens.")).to_be_visible()
    return first, last


def fill_in(sheet, packing):
    """Fill in the form as a data manager would, and store it."""
    packing.get_by_role("button", name="Metadata").click()
    form = sheet.get_by_role("form", name=re.compile("^Metadata of files"))
    person = form.locator("details").filter(has_text="Principal investigator").last
    person.get_by_label("Name").fill("Ann, Ben")
    store = form.get_by_role("button", name=re.compile("^Store metadata of files"))
    store.click()
    expect(form.get_by_role("alert").first).to_be_visible()
    person.get_by_label("Name").fill("Ann")
    person.get_by_label("E-mail").fill("ann@example.org")
    form.get_by_label("Operating agency").fill("A lake station")
    form.get_by_label("Licence").select_option('"CC-BY-4.0"')
    store.click()


def table(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(io.StringIO("\n".join(lines))))


def assert_equal(data, rows, first, last):
    """Hold what a stranger reads in the NetCDF file against the table beside it."""
    named = {
        str(at): row
        for at, row in zip((row["time_utc"].removesuffix("Z") for row in rows), rows, strict=True)
    }
    # seconds in double precision: nearest to the microsecond, and seldom just below it
    times = (data["TIME"].values + np.timedelta64(500, "ns")).astype("datetime64[us]")
    told = flagged = 0
    for at, value, flag in zip(times, data["TEMP"].values, data["TEMP_QC"].values, strict=True):
        if np.isnan(value):
            continue
        row, told = named[str(at)], told + 1
        assert np.float32(row[f"{CHANNEL}_degC"]) == value
        assert int(row[f"{CHANNEL}_qc"]) == int(flag)
        moment = datetime.fromisoformat(row["time_utc"])
        if first <= moment <= last:
            assert flag == 4
            flagged += 1
    assert told >= SAMPLES / 4
    assert flagged >= told // 5
    assert timedelta(0) < last - first
