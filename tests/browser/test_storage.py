"""An administrator sets how long data stay, backs the station up, and restores what was written."""

import subprocess
import sys

import pytest
from playwright.sync_api import Page, expect

from tests.browser.walk import CHROMIUM, browser_page, open_page, shoot
from tests.e2e.demo import ROOT, Demo

pytestmark = [
    pytest.mark.browser,
    pytest.mark.walk,
    pytest.mark.timeout(1200),
    pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine"),
]


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory):
    data = tmp_path_factory.mktemp("storage")
    with (
        Demo(data, "--robots", "mini-1") as demo,
        browser_page(browser, demo) as page,
    ):
        open_page(page, demo, "/settings")
        page.get_by_role("link", name="Sizes and retention").click()
        yield page


def panel(page: Page, name: str):
    return page.get_by_role("region", name=name, exact=True)


def grace(*words):
    done = subprocess.run(
        [sys.executable, "-m", "server.cli", *map(str, words)],
        cwd=ROOT, capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_page_tells_how_large_each_kind_is(page):
    kept = panel(page, "What is kept")
    expect(kept).to_contain_text("bytes are estimated")
    expect(kept.get_by_role("listitem").filter(has_text="State reports")).to_contain_text("rows")
    shoot(page, "storage-sizes")


def test_a_rule_is_stored_once_somebody_looked_at_what_would_go(page):
    rules = panel(page, "How long it stays")
    store = rules.get_by_role("button", name="Store the rules")
    rules.get_by_label("What becomes of it").nth(1).select_option(label="Thin")  # state reports
    expect(rules).to_contain_text("Rules are stored once you looked at what would go.")
    expect(store).to_be_disabled()
    rules.get_by_role("button", name="Look at what would go").click()
    expect(rules.get_by_text("Nothing would go now.")).to_be_visible()
    store.click()
    expect(rules).to_contain_text("changed by demo at")
    shoot(page, "storage-rule")


def test_a_pass_is_made_at_once_and_tells_what_it_did(page):
    passes = panel(page, "Passes")
    expect(passes).to_contain_text("None yet")
    passes.get_by_role("button", name="Do it now").click()
    expect(passes).not_to_contain_text("None yet")
    shoot(page, "storage-pass")


def test_a_backup_that_is_encrypted_is_made_and_restored(page, tmp_path):
    key, folder, elsewhere = tmp_path / "lake.key", tmp_path / "disk", tmp_path / "restored"
    folder.mkdir()
    public_key = grace("db", "backup-key", key).split()[0]
    backups = panel(page, "Backups")
    expect(backups).to_contain_text("No folder is chosen")
    backups.get_by_label("Folder on the station's machine").fill(str(folder))
    backups.get_by_label("Public key").fill(public_key)
    backups.get_by_role("button", name="Save how backups are made").click()
    expect(backups).to_contain_text("For the key")
    backups.get_by_role("button", name="Back up now").click()
    written = backups.get_by_role("region", name="List of backups").get_by_role("row").nth(1)
    expect(written).to_be_visible()
    expect(backups).to_contain_text("read again after it was written")
    shoot(page, "storage-backup")
    [file] = folder.iterdir()
    expect(written).to_contain_text(file.name)
    grace("db", "restore", file, "--key", key, "--data", elsewhere)
    assert "is whole" in grace("db", "check", "--data", elsewhere)
