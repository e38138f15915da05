"""Interactions: what robots want of people, how people answer, and how months change that."""
