"""Expectations of a simulation: how they are added, and their verdicts."""
