"""The run itself: clock, random streams, spans, the loop, and its tables."""
