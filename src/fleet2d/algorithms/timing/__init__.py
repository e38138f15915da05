"""Timing: when and where a person welcomes what, learned from answers alone."""
