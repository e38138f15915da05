"""The stored data of a study: its folder, journal, parts and results."""
