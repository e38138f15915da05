"""Errors of perception: one module for each."""
