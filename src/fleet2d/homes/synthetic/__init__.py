"""Synthetic homes, generated from a seed."""
