"""Behaviors of robots, one per module."""
