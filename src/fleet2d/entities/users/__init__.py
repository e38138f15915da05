"""Behaviors of users, one a module."""
