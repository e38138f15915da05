"""Objects of a home that have a state: doors and sensors."""
