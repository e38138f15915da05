"""The kinds of rows in the table key_frames.

A row is a breakpoint that the body reached (track), the planned end of a segment that was
interrupted before (planned), or the state from which a random walk continues (walk).
"""

TRACK, PLANNED, WALK = 0, 1, 2
KEY_KINDS = ("track", "planned", "walk")
