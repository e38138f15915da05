"""Sight of robots: cameras, and the region that is visible from a place."""
