"""The design of a study: its file, its variants, and the identity of each."""
