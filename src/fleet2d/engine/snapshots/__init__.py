"""Copies of the state of a run, in memory and in files."""
