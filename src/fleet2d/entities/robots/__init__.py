"""Behaviors of robots, one a module."""
