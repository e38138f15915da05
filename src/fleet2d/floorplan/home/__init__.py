"""A floor plan during a run: its present objects and doors, and the space and routes of bodies."""
