"""The paper's results, measured again: speed, presence by days and by gap, the feedback loop."""
