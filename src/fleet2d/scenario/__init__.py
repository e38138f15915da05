"""Scenarios: the YAML file that defines a run, how files compose, and the errors in one."""
