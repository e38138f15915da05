"""Interactions: requests of robots to people, the answers, and how these change over months."""
