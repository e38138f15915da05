"""Furniture: its catalogue, and how a home is furnished."""
