"""Entry point of ``python -m swgjoint``."""

import sys

from swgjoint.cli.main import main

sys.exit(main())
