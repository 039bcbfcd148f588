"""``python -m evaps``: the same as ``evaps``."""

import sys

from evaps.cli import main

sys.exit(main())
