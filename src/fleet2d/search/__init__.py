"""In which order to look for somebody: pure functions of what is believed and how far it is."""
