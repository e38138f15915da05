"""Layouts in which smart homes are published, one module for each."""
