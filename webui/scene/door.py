"""viser behind a socket of this user's own: no port, and no handler that opens another door."""

import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import viser
from viser import _messages
from websockets.asyncio import server

_LONGEST_PATH = 100
"""Bytes; the operating system takes 103 to 107."""
_UNUSED = (
    _messages.ShareUrlRequest,
    _messages.ShareUrlDisconnect,
    _messages.FileTransferStartUpload,
    _messages.FileTransferPart,
    _messages.CommandTriggerMessage,
    _messages.GuiFormSubmitMessage,
    _messages.GuiFormDirtyMessage,
    _messages.GuiButtonHoldMessage,
)
"""What viser does for browsers and no scene needs: a public tunnel, uploads, commands, forms."""


class PrivateServer:
    """A viser server that listens on a socket in a folder that nobody else can enter."""

    def __init__(self, label: str) -> None:
        self._folder = _new_folder()
        self.socket = self._folder / "viser"
        try:
            with _listening_on(self.socket):
                self.viser = viser.ViserServer(host="localhost", port=0, label=label, verbose=False)
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise
        inside = self.viser._websock_server  # noqa: SLF001 # pyright: ignore[reportPrivateUsage]
        for message in _UNUSED:
            inside.unregister_handler(message)

    def stop(self) -> None:
        """End viser's thread and take the socket away."""
        self.viser.stop()
        shutil.rmtree(self._folder, ignore_errors=True)


def _new_folder() -> Path:
    """Return a new folder of mode 0700, where the path of a socket is short enough."""
    folder = Path(tempfile.mkdtemp(prefix="grace-view-"))
    if len(bytes(folder)) <= _LONGEST_PATH - len("/viser"):
        return folder
    folder.rmdir()
    return Path(tempfile.mkdtemp(prefix="grace-view-", dir="/tmp"))


@contextmanager
def _listening_on(path: Path) -> Generator[None]:
    """Have viser, which knows TCP alone, listen on a path; it prints no address, for it has none.

    viser's thread looks the function up and has called it by the time that its constructor returns.
    """
    serve = server.serve

    def serve_path(handler: Any, host: str, port: int, **options: Any) -> server.serve:  # noqa: ANN401 - viser's own
        del host, port
        return serve(handler, unix=True, path=str(path), **options)

    with patch.object(server, "serve", serve_path), patch("rich.print"):
        yield
