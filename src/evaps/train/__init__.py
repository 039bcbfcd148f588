"""Training: one loop for all, and for each method what it learns from."""

from evaps.train.methods import train

__all__ = ["train"]
