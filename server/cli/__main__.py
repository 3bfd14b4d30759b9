"""``python -m server.cli`` is ``grace``."""

import sys

from server.cli.main import main

sys.exit(main())
