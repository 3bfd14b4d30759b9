"""No bytes from outside may do more than be refused."""

import contextlib
import tracemalloc
from pathlib import Path

import pytest

from tests.parser.catalogue import catalogue
from tests.parser.garbage import garbage

PARSERS = {parser.name: parser for parser in catalogue()}
CORPUS = Path(__file__).parents[1] / "data" / "corpus"
BYTES = 60_000
MEMORY_BYTES = 2_000_000


@pytest.mark.parametrize("name", PARSERS)
def test_a_capture_is_understood(name):
    parser = PARSERS[name]
    for capture in parser.captures:
        with contextlib.suppress(*parser.refusals):
            parser.make()(capture)
            return
    pytest.fail("not one capture was taken")


@pytest.mark.parametrize("name", PARSERS)
def test_garbage_is_refused_without_a_fault(name):
    parser = PARSERS[name]
    feed = parser.make()
    for data in garbage(parser, 1, BYTES):
        with contextlib.suppress(*parser.refusals):
            feed(data)


@pytest.mark.parametrize("name", ["xbee_plain", "xbee_escaped", "mavlink_stream", "acoustic"])
def test_a_stream_of_garbage_holds_no_growing_memory(name):
    parser = PARSERS[name]
    feed = parser.make()
    tracemalloc.start()
    for data in garbage(parser, 2, BYTES):
        feed(data)
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < MEMORY_BYTES


@pytest.mark.parametrize("name", PARSERS)
def test_what_a_search_for_faults_found_worth_keeping_is_refused_or_taken(name):
    parser = PARSERS[name]
    for file in sorted((CORPUS / name).glob("*")):
        with contextlib.suppress(*parser.refusals):
            parser.make()(file.read_bytes())
