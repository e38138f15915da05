"""Executors: they run the variants of a study in this process, in others, or on Ray."""
