"""Where programs run: robots, their worlds, and worker processes that have them. No torch."""
