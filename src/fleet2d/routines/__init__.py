"""How people spend their days: activities, personas, the planner, households, the survey."""
