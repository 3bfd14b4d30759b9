"""Reads files as an upload of them is read."""

from collections.abc import Sequence
from pathlib import Path

from server.recording_file.raw import RawRecording
from server.recording_file.reading import read_files


def read(folder: Path, paths: Sequence[Path]) -> RawRecording:
    """Return the recording in some files; archives unpack into a folder below."""
    unpacked = folder / "unpacked"
    unpacked.mkdir(parents=True, exist_ok=True)
    raw = read_files([(path.name, path) for path in paths], unpacked, lambda share: None)
    assert isinstance(raw, RawRecording)
    return raw


def written(folder: Path, name: str, text: str | bytes) -> Path:
    """Write a file."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path
