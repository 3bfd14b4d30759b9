"""JSON, XML and KMZ of others: read whole, within limits, without entities and loads.

What is wrong is told as ``ReadingError`` with the line or entry at fault.
"""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from server.water.proposal import ReadingError

BYTES_MAX = 64 << 20
DEPTH_MAX = 100
"""Brackets within brackets, or elements within elements."""
KMZ_ENTRIES_MAX = 200
KMZ_RATIO_MAX = 200
_ZIP_FAULTS = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    NotImplementedError,
    RuntimeError,
    EOFError,
    OSError,
    ValueError,
)
"""What the archive reader raises of archives that are damaged."""


def file_bytes(path: Path) -> bytes:
    """Return what a file holds.

    Raises:
        ReadingError: If it is empty or too large.
    """
    size = path.stat().st_size
    if size > BYTES_MAX:
        raise ReadingError(("", f"{size / 2**20:.0f} MB are more than the {BYTES_MAX >> 20} taken"))
    if size == 0:
        raise ReadingError(("", "the file is empty"))
    return path.read_bytes()


def text_of(content: bytes) -> str:
    """Return a file as text.

    Raises:
        ReadingError: If it is no UTF-8.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ReadingError(("", f"the file is no UTF-8 text: byte {error.start}")) from error


def json_document(content: bytes) -> Any:  # noqa: ANN401 - any JSON
    """Return a JSON document.

    Raises:
        ReadingError: With the line at fault; also of NaN and infinities, which JSON does not have.
    """
    try:
        document = json.loads(text_of(content), parse_constant=_no_number)
    except json.JSONDecodeError as error:
        raise ReadingError((f"line {error.lineno}", f"no JSON: {error.msg}")) from error
    except ValueError as error:
        if isinstance(error, ReadingError):
            raise
        raise ReadingError(("", f"no JSON: {error}")) from error
    except RecursionError as error:
        raise ReadingError(("", "the file is nested too deeply")) from error
    _refuse_deep(document)
    return document


def _no_number(name: str) -> float:
    raise ReadingError(("", f"{name} is no number of JSON"))


def _refuse_deep(document: object) -> None:
    level = [document]
    for _ in range(DEPTH_MAX + 1):
        level = [
            inner
            for outer in level
            if isinstance(outer, list | dict)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, list | dict)
        ]
        if not level:
            return
    raise ReadingError(("", f"the file is nested too deeply: {DEPTH_MAX} levels are the most"))


@dataclass(frozen=True, slots=True)
class XmlDocument:
    """A tree, and the line on which each of its elements begins."""

    root: Element
    lines: Mapping[Element, int]


def xml_document(content: bytes) -> XmlDocument:
    """Return an XML document.

    Raises:
        ReadingError: With the line at fault; also of a document type and of entities.
    """
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import DefusedXMLParser, parse

    builder = _LinedBuilder()
    parser = DefusedXMLParser(target=builder, forbid_dtd=True)
    builder.source = parser.parser
    try:
        root = parse(io.BytesIO(content), parser=parser).getroot()
    except ParseError as error:
        raise ReadingError((f"line {error.position[0]}", f"no XML: {error}")) from error
    except DefusedXmlException as error:
        raise ReadingError(("", "the file declares entities or a document type")) from error
    except (ValueError, LookupError) as error:
        if isinstance(error, ReadingError):
            raise
        raise ReadingError(("", f"no XML: {error}")) from error
    if root is None:
        raise ReadingError(("", "the file is empty"))
    return XmlDocument(root, builder.lines)


class _LinedBuilder(TreeBuilder):
    """Builds a tree and notes where each element begins."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[Element, int] = {}
        self.source: Any = None
        self._level = 0

    def start(self, tag: Any, attrs: Any, /) -> Element:  # noqa: ANN401 - the base's
        self._level += 1
        line = int(self.source.CurrentLineNumber)
        if self._level > DEPTH_MAX:
            raise ReadingError((f"line {line}", f"more than {DEPTH_MAX} elements in one another"))
        element = super().start(tag, attrs)
        self.lines[element] = line
        return element

    def end(self, tag: Any, /) -> Element:  # noqa: ANN401 - the base's
        self._level -= 1
        return super().end(tag)


def tag(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def kmz_document(file: Path | IO[bytes], bytes_max: int = BYTES_MAX) -> bytes:
    """Return the KML document of a KMZ archive: the outermost, ``doc.kml`` first.

    Raises:
        ReadingError: With the entry at fault.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            entries = archive.infolist()
            _check_archive(entries, bytes_max)
            first = _first_document(entries)
            with archive.open(first) as opened:
                content = opened.read(bytes_max + 1)  # whatever the directory says
    except ReadingError:
        raise
    except _ZIP_FAULTS as error:
        raise ReadingError(("", f"no KMZ archive: {error}")) from error
    if len(content) > bytes_max:
        raise ReadingError((first.filename, f"unpacks to more than {bytes_max >> 20} MB"))
    return content


def _first_document(entries: Sequence[zipfile.ZipInfo]) -> zipfile.ZipInfo:
    documents = [entry for entry in entries if entry.filename.lower().endswith(".kml")]
    if not documents:
        raise ReadingError(("", "the archive holds no KML document"))
    return min(documents, key=lambda e: (e.filename.count("/"), e.filename != "doc.kml"))


def _check_archive(entries: Sequence[zipfile.ZipInfo], bytes_max: int) -> None:
    if len(entries) > KMZ_ENTRIES_MAX:
        raise ReadingError(
            ("", f"{len(entries)} entries are more than the {KMZ_ENTRIES_MAX} taken")
        )
    if sum(entry.file_size for entry in entries) > bytes_max:
        raise ReadingError(("", f"the archive unpacks to more than {bytes_max >> 20} MB"))
    for entry in entries:
        if entry.file_size > KMZ_RATIO_MAX * max(entry.compress_size, 1024):
            raise ReadingError(
                (entry.filename, f"unpacks to more than {KMZ_RATIO_MAX} times its size")
            )
