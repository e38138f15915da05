"""The kinds of rows in the table key_frames.

A row is a breakpoint that was reached (track), the end of a segment that was broken off before it
(planned), or a state from which a random walk is drawn on (walk).
"""

TRACK, PLANNED, WALK = 0, 1, 2
KEY_KINDS = ("track", "planned", "walk")
