"""``python -m server.command`` is ``grace``."""

import sys

from server.command.main import main

sys.exit(main())
