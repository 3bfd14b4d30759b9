"""Generate the dialect module from ``grace.xml``: ``python -m robot_link.mavlink.build``.

pymavlink's generator needs the included XML files beside ours; they come from the installed
pymavlink, so nothing of it is copied into the source tree. The output is written beside this
file, whole or not at all, and compiled at once: compiling it at import would cost every process
70 MB.
"""

import contextlib
import io
import py_compile
import shutil
import sys
import tempfile
from pathlib import Path

import pymavlink
from pymavlink.generator import mavgen, mavparse

HERE = Path(__file__).parent
INCLUDED = ("common.xml", "standard.xml", "minimal.xml")


def build(target: Path, source: Path | None = None) -> None:
    """Write the dialect to ``target`` and an empty package around it.

    Args:
        target: The module.
        source: The dialect's XML, by default ``grace.xml`` beside this file.

    Raises:
        RuntimeError: If the generator refuses ``grace.xml``; the message is the generator's own.
    """
    definitions = Path(pymavlink.__file__).parent / "dialects" / "v20"
    with tempfile.TemporaryDirectory() as folder:
        for name in INCLUDED:
            shutil.copy(definitions / name, folder)
        shutil.copy(source or HERE / "grace.xml", Path(folder) / "grace.xml")
        generated = Path(folder) / "grace.py"
        said = io.StringIO()
        options = mavgen.Opts(str(generated), mavparse.PROTOCOL_2_0, language="Python3")
        with (
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
            contextlib.suppress(SystemExit),  # how the generator says that it refuses the XML
        ):
            mavgen.mavgen(options, [str(Path(folder) / "grace.xml")])
        if not generated.exists():
            raise RuntimeError(f"the MAVLink generator refused grace.xml:\n{said.getvalue()}")
        target.parent.mkdir(exist_ok=True)
        (target.parent / "__init__.py").touch()
        staged = target.with_suffix(".new")
        shutil.copy(generated, staged)
        staged.replace(target)
        py_compile.compile(str(target), doraise=True)


if __name__ == "__main__":
    destination = HERE / "dialect" / "grace.py"
    build(destination)
    sys.stdout.write(f"MAVLink dialect written to {destination.name}\n")
