"""What a real robot perceived, in place of simulated sight: from a log, or as it arrives."""
