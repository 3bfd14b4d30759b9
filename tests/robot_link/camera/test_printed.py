"""Plates and the board as a PDF: read back, drawn, found by the detector, and of true size."""

import re

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.camera.board import BOARD, find_board, opencv_board
from robot_link.camera.detector import TagDetector
from robot_link.camera.printed.pdf import Page, pdf_of
from robot_link.camera.printed.sheet import board_page, ids_of, tag_pages

PER_MM = 6
MM_PER_POINT = 25.4 / 72.0


def objects_of(pdf):
    """Return each object by the table at the end of the file, which must be right."""
    table = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", pdf)[1])
    lines = pdf[table:].split(b"\n")
    assert lines[0] == b"xref"
    found = {}
    for number, line in enumerate(lines[3 : 2 + int(lines[1].split()[1])], start=1):
        at = int(line[:10])
        assert pdf[at:].startswith(b"%d 0 obj\n" % number)
        found[number] = pdf[at : pdf.index(b"\nendobj", at)]
    return found


def drawn_pages(pdf):
    """Return each page as a picture of ``PER_MM`` px a millimetre, and its words."""
    objects = objects_of(pdf)
    for body in objects.values():
        if b"/Type /Page " not in body:
            continue
        numbers = re.search(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", body)
        width, height = (float(one) * MM_PER_POINT for one in numbers.groups())
        content = objects[int(re.search(rb"/Contents (\d+) 0 R", body)[1])]
        length = int(re.search(rb"/Length (\d+)", content)[1])
        stream = content.split(b"stream\n", 1)[1][:length].decode()
        yield drawn(stream, width, height), re.findall(r"\((.*)\) Tj", stream), (width, height)


def drawn(stream, width, height):
    """Return a page; rectangles are drawn exactly, by how much of each pixel they cover."""
    grey = np.ones((round(height * PER_MM), round(width * PER_MM)))
    for line in stream.splitlines():
        words = line.split()
        if words[0] == "BT":
            continue
        numbers = [float(w) * MM_PER_POINT for w in words[2:] if re.fullmatch(r"-?[\d.]+", w)]
        covered = np.zeros_like(grey)
        if "re" in words:
            for x, y, w, h in np.reshape(numbers, (-1, 4)):
                rows, down = share(height - y - h, height - y)
                columns, across = share(x, x + w)
                covered[rows, columns] += np.outer(down, across)
        else:
            corners = np.reshape(numbers, (-1, 2))
            corners = np.column_stack([corners[:, 0], height - corners[:, 1]]) * PER_MM - 0.5
            cv2.fillPoly(covered, [np.round(corners).astype(np.int32)], (1.0,))
        covered = np.minimum(covered, 1.0)
        grey = (1.0 - covered) * grey + covered * float(words[0])
    return np.round(255.0 * grey).astype(np.uint8)


def share(begin_mm, end_mm):
    """Return the pixels between two places of an axis, and how much of each lies there."""
    first, last = int(begin_mm * PER_MM), int(np.ceil(end_mm * PER_MM))
    edges = np.arange(first, last + 1)
    return slice(first, last), np.diff(np.clip(edges, begin_mm * PER_MM, end_mm * PER_MM))


@pytest.mark.parametrize(
    ("ids", "size_mm", "pages"),
    [("0-2", 100.0, 2), ("100-107", 60.0, 2), ("0,33,98,200", 40.0, 1), ("150", 240.0, 1)],
)
def test_every_plate_is_found_upright_and_of_its_true_size(ids, size_mm, pages):
    seen = {}
    all_words = []
    for grey, words, paper in drawn_pages(pdf_of(tag_pages(ids_of(ids), size_mm))):
        assert paper[0] <= 594.1
        all_words += words
        for tag in TagDetector(1.0).find(cv2.GaussianBlur(grey, (0, 0), 0.7), [], 2.0).tags:
            seen[tag.id] = np.array(tag.corners_px) / PER_MM
        pages -= 1
    assert pages == 0
    assert sorted(seen) == sorted(ids_of(ids))
    for corners in seen.values():
        sides = np.roll(corners, -1, axis=0) - corners
        assert np.linalg.norm(sides, axis=1) == pytest.approx(size_mm, abs=0.15)
        assert sides[0] == pytest.approx([size_mm, 0.0], abs=0.15)
    for tag_id in seen:
        assert any(f"id {tag_id}  {size_mm:g} mm" in words for words in all_words)


def test_plates_lie_apart_and_whole_on_their_sheet():
    ((grey, _, (width, height)),) = drawn_pages(pdf_of(tag_pages(ids_of("100-105"), 60.0)))
    assert (width, height) == pytest.approx((210.0, 297.0), abs=0.01)
    tags = TagDetector(1.0).find(grey, [], 2.0).tags
    assert len(tags) == 6
    middles = np.array([np.mean(tag.corners_px, axis=0) for tag in tags]) / PER_MM
    apart = np.abs(middles[:, None] - middles).max(axis=2) + 1e3 * np.eye(len(tags))
    assert apart.min() > 75.0
    assert (middles > 37.5).all()
    assert (middles < np.array([width, height]) - 37.5).all()


def test_the_board_is_that_of_opencv_in_true_size():
    ((grey, words, paper),) = drawn_pages(pdf_of([board_page()]))
    assert paper == pytest.approx((594.0, 420.0), abs=0.01)
    assert words
    found = find_board(grey)
    assert len(found) == 70
    pixels = np.array([corner.pixel for corner in found]) / PER_MM
    points = 1e3 * BOARD.points_m([corner.id for corner in found])[:, :2]
    assert pixels - pixels[0] == pytest.approx(points - points[0], abs=0.15)
    fine = 4 * PER_MM
    theirs = np.asarray(opencv_board().generateImage((11 * fine, 8 * fine), marginSize=0))
    left, top = (pixels[0] - points[0]) * PER_MM
    ours = grey[round(top) :, round(left) :][: 8 * 50 * PER_MM, : 11 * 50 * PER_MM]
    small = cv2.resize(ours, (11 * fine, 8 * fine), interpolation=cv2.INTER_AREA)
    assert np.mean(np.abs(small.astype(int) - theirs) > 128) < 0.03


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "neither a number"),
        ("a", "neither a number"),
        ("2-1", "runs backwards"),
        ("99", "are not ids of robots"),
        ("90-110", "are not ids of robots"),
        ("216", "are not ids of robots"),
        ("1,1", "one is there twice"),
        ("-1", "neither a number"),
        ("²", "neither a number"),
    ],
)
def test_ids_that_are_none_are_refused(text, complaint):
    with pytest.raises(ValueError, match=complaint):
        ids_of(text)


@pytest.mark.parametrize("size_mm", [0.0, 19.0, 601.0, float("nan"), float("inf")])
def test_a_size_that_cannot_be_printed_is_refused(size_mm):
    with pytest.raises(ValueError, match="size: "):
        tag_pages([0], size_mm)


@given(text=st.text(max_size=30))
def test_no_words_break_the_file(text):
    page = Page(100.0, 100.0)
    page.words((10.0, 10.0), text, 3.0)
    objects_of(pdf_of([page]))
    inner = page.content().decode().partition("(")[2].rpartition(")")[0]
    assert not re.search(r"(?<!\\)(\\\\)*[()]", inner)
