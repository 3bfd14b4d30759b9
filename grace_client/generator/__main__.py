"""``python -m grace_client.generator DOCUMENT``: write the models and the methods."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

from grace_client.generator import models, operations

PLACE = Path(__file__).parents[1] / "generated"


def main() -> None:
    """Read ``grace openapi``'s output from a file, or from the input for ``-``."""
    source = sys.argv[1]
    text = sys.stdin.read() if source == "-" else Path(source).read_text()
    document = json.loads(text)
    schemas = document["components"]["schemas"]
    schemas["JsonValue"] = {}
    schemas["JobView"]["properties"]["result"] = {"anyOf": [{"type": "object"}, {"type": "null"}]}
    PLACE.mkdir(exist_ok=True)
    version = document["info"]["version"]
    (PLACE / "__init__.py").write_text(
        f'"""Made of the OpenAPI document of the station {version}."""\n\n'
        f'STATION_VERSION = "{version}"\n'
        f'DOCUMENT_SHA256 = "{hashlib.sha256(text.encode()).hexdigest()}"\n'
    )
    (PLACE / "models.py").write_text(models.module_of(schemas))
    (PLACE / "operations.py").write_text(operations.module_of(document))
    subprocess.run([sys.executable, "-m", "ruff", "format", "--quiet", str(PLACE)], check=False)


if __name__ == "__main__":
    main()
