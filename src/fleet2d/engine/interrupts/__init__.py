"""Interrupts: conditions that end plans when they become true; one condition a module."""
