"""The commands, one a module: the function of the module's name, or a Typer app of several.

They need no mention elsewhere: `scenario_diff` in `scenario_diff.py` is `fleet2d scenario-diff`.
A module is imported when its command is called, and should import what it needs then, too.
"""
