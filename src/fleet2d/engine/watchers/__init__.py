"""Watchers: they follow the bodies of a run and emit events: cameras, sensors, encounters."""
