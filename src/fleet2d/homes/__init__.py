"""Homes that other programs made, in their formats, and homes that are made up from a seed."""
