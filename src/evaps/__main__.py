"""``python -m evaps``: the command line."""

import sys

from evaps.cli.main import main

sys.exit(main())
