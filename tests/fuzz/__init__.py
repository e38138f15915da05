"""Fuzzers of every reader: what is nearly right, and must be read or refused in plain words."""
