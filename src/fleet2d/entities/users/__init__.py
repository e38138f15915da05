"""Behaviors of users, one per module."""
