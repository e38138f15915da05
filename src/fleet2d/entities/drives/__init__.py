"""Drives of robots: how they move along a route, one per module."""
