"""Homes that no one has built: generated from a seed."""
