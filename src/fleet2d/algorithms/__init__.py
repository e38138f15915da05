"""What learns during a run: the base of algorithms, their history and their output."""
