"""Algorithms, which learn during a run: their base, their history and their output."""
