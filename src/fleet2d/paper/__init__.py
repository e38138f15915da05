"""The paper's results, measured anew: speed, presence by days and by gap, the feedback loop."""
