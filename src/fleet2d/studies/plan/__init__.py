"""The plan of a study: all its variants, checked and stored, and the time that they will take."""
