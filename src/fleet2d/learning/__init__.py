"""Learning: data sets of many homes, environments for agents, and models fitted to logs."""
