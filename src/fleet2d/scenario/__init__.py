"""Scenarios: the YAML file that defines a run, how files compose, and what is wrong with one."""
