"""Builds the operator app into ``webui/dist`` with node from the machine or from the lock file.

The operator's manual becomes pages there, too. ``python -m webui.build`` builds when a source
changed; ``python -m webui.build check`` runs the app's type checker, linter and unit tests;
``python -m webui.build packages`` only installs what a build needs, with the node of the machine,
and does nothing where that has none.
"""

import gzip
import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent
APP = HERE / "app"
DIST = HERE / "dist"
STAMP = DIST / "source.sha256"
MANUAL = ROOT / "docs" / "manual"
MANUAL_WRITER = HERE / "manual.py"
NODE_LOCK = ROOT / "requirements-node.lock"
SMALLEST_NODE = 20
NOT_SOURCES = {"node_modules", "dist", "python.sha256"}
GENERATED = APP / "src" / "api" / "generated"
DOCUMENT = GENERATED / "openapi.json"
TYPES = GENERATED / "station.d.ts"
TYPED_BY = ("autonomy", "db", "robot_link", "server", "webui")
"""Packages whose sources may change the station's OpenAPI document."""


class BuildError(Exception):
    """The app cannot be built; the message is for the person at the terminal."""


def main(arguments: list[str]) -> int:
    """Build or check the app; returns the exit status."""
    if arguments not in ([], ["check"], ["packages"]):
        sys.stderr.write("usage: python -m webui.build [check | packages]\n")
        return 2
    try:
        if arguments == ["packages"]:
            if _npm_found() is not None:
                _install_packages()
        elif arguments:
            _install_packages()
            _generate_types()
            for script in ("check", "test"):
                _npm("run", script)
        else:
            _build_if_stale()
    except BuildError as error:
        sys.stderr.write(f"webui.build: {error}\n")
        return 1
    return 0


def dev_command(host: str, port: str, station_url: str) -> tuple[str, ...]:
    """Return what serves the app from its sources, with the station behind it; see ``APP``.

    Raises:
        BuildError: If its packages cannot be installed or its types not be generated.
    """
    if not (APP / "package-lock.json").exists():
        raise BuildError("the app's sources are not installed; --dev needs the source tree")
    _install_packages()
    _generate_types()
    node = str(Path(_npm_path()).with_name("node"))
    vite = str(APP / "node_modules" / "vite" / "bin" / "vite.js")
    where = ("--host", host, "--port", port, "--strictPort", "--clearScreen", "false")
    return ("env", f"GRACE_STATION={station_url}", node, vite, *where)


def _build_if_stale() -> None:
    _generate_types()
    digest = _source_digest()
    if STAMP.exists() and STAMP.read_text() == digest:
        return
    sys.stdout.write("Building the operator app\n")
    _install_packages()
    _npm("run", "build")
    if not (DIST / "index.html").exists():
        raise BuildError("the build ended without webui/dist/index.html")
    _write_manual()
    STAMP.write_text(digest)


def _write_manual() -> None:
    # here, because `packages` runs before anything is installed
    from webui.manual import ManualError, write_pages

    template = DIST / "help.html"
    try:
        write_pages(MANUAL, template.read_text(encoding="utf-8"), DIST / "help")
    except ManualError as error:
        raise BuildError(f"the manual: {error}") from error
    for made in DIST.glob("help.html*"):
        made.unlink()
    for page in [path for path in (DIST / "help").iterdir() if path.suffix in (".html", ".json")]:
        packed = gzip.compress(page.read_bytes(), mtime=0)
        page.with_name(f"{page.name}.gz").write_bytes(packed)


def _generate_types() -> None:
    """Generate the app's types from what the station's sources say of its REST interface."""
    stamp = GENERATED / "python.sha256"
    sources = [path for package in TYPED_BY for path in (ROOT / package).rglob("*.py")]
    digest = _digest(ROOT, sources)
    if TYPES.exists() and stamp.exists() and stamp.read_text() == digest:
        return
    GENERATED.mkdir(exist_ok=True)
    before = DOCUMENT.read_bytes() if DOCUMENT.exists() else b""
    _run([sys.executable, "-m", "server.cli", "openapi", "--out", str(DOCUMENT)], ROOT)
    if not TYPES.exists() or DOCUMENT.read_bytes() != before:
        _install_packages()
        _npm("run", "types")
    stamp.write_text(digest)


def _source_digest() -> str:
    parts = ((path, path.relative_to(APP).parts) for path in APP.rglob("*"))
    app = [path for path, inside in parts if not NOT_SOURCES.intersection(inside)]
    return _digest(ROOT, [*app, *MANUAL.rglob("*"), MANUAL_WRITER])


def _digest(root: Path, paths: list[Path]) -> str:
    digest = hashlib.sha256()
    for path in sorted(path for path in paths if path.is_file()):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _install_packages() -> None:
    lock = APP / "package-lock.json"
    stamp = APP / "node_modules" / ".lock.sha256"
    digest = hashlib.sha256(lock.read_bytes()).hexdigest()
    if stamp.exists() and stamp.read_text() == digest:
        return
    _npm("ci", "--no-audit", "--no-fund")
    stamp.write_text(digest)


def _npm(*arguments: str) -> None:
    _run([_npm_path(), "--loglevel=error", *arguments], APP, _environment())


def _run(command: list[str], folder: Path, environment: dict[str, str] | None = None) -> None:
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env=environment
    )
    if done.returncode != 0:
        words = " ".join([Path(command[0]).name, *command[1:]])
        raise BuildError(f"{words} failed:\n{done.stdout}{done.stderr}")


def _environment() -> dict[str, str]:
    return {**os.environ, "PATH": f"{Path(_npm_path()).parent}:{os.environ.get('PATH', '')}"}


def _npm_path() -> str:
    """Find npm, or install the wheel that brings it."""
    found = _npm_found()
    if found is not None:
        return found
    sys.stdout.write("Installing node, which this machine lacks, from its wheel\n")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
           "--require-hashes", "-r", str(NODE_LOCK)]  # fmt: skip
    if subprocess.run(pip, check=False).returncode != 0:
        raise BuildError("node 20 or newer is neither on this machine nor installable")
    return str(Path(sys.executable).with_name("npm"))


def _npm_found() -> str | None:
    """Find npm beside a node of at least version 20."""
    for node in (shutil.which("node"), str(Path(sys.executable).parent / "node")):
        if node and Path(node).exists() and _node_version(node) >= SMALLEST_NODE:
            npm = Path(node).with_name("npm")
            if npm.exists():
                return str(npm)
    return None


def _node_version(node: str) -> int:
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    found = re.match(r"v(\d+)\.", said)
    return int(found[1]) if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
