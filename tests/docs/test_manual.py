"""The operator's manual: it renders whole, its pictures are small, and its words are the app's."""

import json
import re
from pathlib import Path

import pytest

from tests.e2e.demo import ROOT
from webui.manual import ManualError, read_manual, write_pages

MANUAL = ROOT / "docs" / "manual"
APP = ROOT / "webui" / "app" / "src"
WORDS_OF_STATION = ("server", "autonomy", "robot_link", "onboard")
LARGEST_PICTURE_BYTES = 150_000
GAP = "…"
HOLE = r"\s?(?:\$?\{[^{}]*(?:\{[^{}]*\}[^{}]*)*\}|NAME|…)\s?"
"""What a text of the app is filled with."""


def app_words() -> str:
    """Return the sources of the app and of what the station tells it, blanks made one."""
    sources = [path for path in APP.rglob("*") if path.suffix in (".svelte", ".ts")]
    sources = [path for path in sources if "generated" not in path.parts]
    for package in WORDS_OF_STATION:
        sources += (ROOT / package).rglob("*.py")
    text = "\n".join(path.read_text() for path in sources if not path.name.endswith(".test.ts"))
    return re.sub(r"\s+", " ", text)


def quoted(chapter: str) -> list[str]:
    """Return the words of a chapter that stand on the screen as they are written: the bold ones."""
    return [re.sub(r"\s+", " ", found) for found in re.findall(r"\*\*(.+?)\*\*", chapter)]


def absent(names: list[str], words: str) -> list[str]:
    """Return the names that no source has; a gap stands for whatever a text is filled with."""

    def is_there(name: str) -> bool:
        pattern = HOLE.join(re.escape(part.strip()) for part in name.split(GAP))
        return re.search(rf"(?<![a-z]){pattern}(?![a-z])", words) is not None

    return [name for name in dict.fromkeys(names) if not is_there(name)]


def test_the_manual_has_no_dangling_link_and_names_every_chapter() -> None:
    chapters = read_manual(MANUAL)
    assert [chapter.key for chapter in chapters][:3] == ["", "first-day", "fleet"]
    assert len(chapters) == len(list(MANUAL.glob("*.md")))


def test_every_name_on_the_screen_that_the_manual_quotes_is_in_the_sources() -> None:
    words = app_words()
    faults = {
        path.name: found
        for path in sorted(MANUAL.glob("*.md"))
        if (found := absent(quoted(path.read_text()), words))
    }
    assert faults == {}


def test_a_name_that_no_source_has_is_found_out() -> None:
    words = "a button: Surface {robot.name} now, and: `Save a version`"
    names = [f"Surface {GAP} now", "Save a version", f"Launch {GAP} now", "Save a vers"]
    assert absent(names, words) == [f"Launch {GAP} now", "Save a vers"]


def test_pictures_are_small_and_none_is_left_over() -> None:
    shown = {picture for chapter in read_manual(MANUAL) for picture in chapter.pictures}
    kept = {path.relative_to(MANUAL).as_posix() for path in (MANUAL / "images").iterdir()}
    assert kept == shown
    sizes = {name: (MANUAL / name).stat().st_size for name in kept}
    assert {name: size for name, size in sizes.items() if size > LARGEST_PICTURE_BYTES} == {}


def linked_sections() -> set[str]:
    """Return every section of the manual that the app opens."""
    patterns = (r"manual: '([^']+)'", r"<ManualLink\s+to=\"([^\"]+)\"", r"manualPath\('([^']+)'\)")
    text = "\n".join(
        path.read_text() for path in APP.rglob("*") if path.suffix in (".svelte", ".ts")
    )
    return {found for pattern in patterns for found in re.findall(pattern, text)}


def test_every_section_that_the_app_opens_exists() -> None:
    known = {
        f"{chapter.key}#{section.anchor}" for chapter in read_manual(MANUAL)
        for section in chapter.sections
    } | {chapter.key for chapter in read_manual(MANUAL)}  # fmt: skip
    linked = linked_sections()
    assert len(linked) > 5
    assert linked - known == set()


def test_every_page_of_the_app_has_its_chapter() -> None:
    table = (APP / "page" / "route.ts").read_text().split("as const")[0]
    entries = re.findall(r"\{ key: '(\w+)'[^}]*\}", table.replace("\n", " "))
    with_chapter = re.findall(r"\{ key: '(\w+)'[^}]*manual: '", table.replace("\n", " "))
    assert entries
    assert with_chapter == entries


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "images").mkdir()
    (tmp_path / "README.md").write_text("# Contents\n\n- [One](one.md)\n")
    (tmp_path / "one.md").write_text("# One\n\nFirst words.\n\n## Then & now\n\nMore `words`.\n")
    return tmp_path


def test_pages_are_written_with_navigation_anchors_and_what_is_searched(folder: Path) -> None:
    write_pages(folder, "<!--title-->|<!--chapters-->|<!--text-->", folder / "out")
    page = (folder / "out" / "one.html").read_text()
    assert page.startswith("One|")
    assert '<a href="/help/one" aria-current="page">One</a>' in page
    assert '<h2 id="then-now">Then &amp; now</h2>' in page
    sections = json.loads((folder / "out" / "sections.json").read_text())
    assert sections == [
        {"address": "/help/one", "chapter": "One", "title": "One", "text": "First words."},
        {"address": "/help/one#then-now", "chapter": "One", "title": "Then & now",
         "text": "More words."},
    ]  # fmt: skip


def test_markup_in_a_chapter_is_shown_and_not_run(folder: Path) -> None:
    (folder / "one.md").write_text("# One\n\n<script>alert(1)</script> [x](javascript:alert)\n")
    write_pages(folder, "<!--title-->|<!--text-->", folder / "out")
    page = (folder / "out" / "one.html").read_text()
    assert "<script" not in page
    assert 'href="javascript' not in page


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("[gone](gone.md)", "links to gone"),
        ("[gone](#gone)", "links to one#gone"),
        ("[out](../README.md)", "outside the manual"),
        ("[out](https://example.org)", "outside the manual"),
        ("![gone](images/gone.png)", "images/gone.png, which is missing"),
    ],
)
def test_what_leads_nowhere_stops_the_build(folder: Path, words: str, reason: str) -> None:
    (folder / "one.md").write_text(f"# One\n\n{words}\n")
    with pytest.raises(ManualError, match=re.escape(reason)):
        read_manual(folder)


def test_a_chapter_that_the_contents_leave_out_stops_the_build(folder: Path) -> None:
    (folder / "two.md").write_text("# Two\n")
    with pytest.raises(ManualError, match="does not name two"):
        read_manual(folder)


def test_a_chapter_without_a_title_stops_the_build(folder: Path) -> None:
    (folder / "one.md").write_text("Words.\n")
    with pytest.raises(ManualError, match="does not begin with its title"):
        read_manual(folder)
