"""The client is generated where that was not done yet, as ``make client`` does."""

import importlib.util
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

if importlib.util.find_spec("grace_client.generated") is None:
    document = subprocess.run(
        [sys.executable, "-m", "server.cli", "openapi"], cwd=ROOT, capture_output=True, check=True
    )
    subprocess.run(
        [sys.executable, "-m", "grace_client.generator", "-"],
        cwd=ROOT,
        input=document.stdout,
        check=True,
    )
