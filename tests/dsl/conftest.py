"""Lets the tests of this folder import `random_programs`, and take as long as a busy machine makes them."""

import sys
from pathlib import Path

from hypothesis import settings

sys.path.append(str(Path(__file__).parent))
settings.register_profile("dsl", deadline=None, max_examples=60)
settings.load_profile("dsl")
