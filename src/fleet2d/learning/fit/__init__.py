"""Models fitted to logs: personas from diaries of people, perception from a robot's detections."""
