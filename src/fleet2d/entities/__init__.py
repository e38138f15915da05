"""Bodies in the home: users and robots, their behaviors and plans."""
