"""The facts that the page receives about a run: the home, everybody, marks, sightings and walls."""
