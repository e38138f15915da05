"""Routines of people: activities, personas, the planner of days, households, the survey."""
