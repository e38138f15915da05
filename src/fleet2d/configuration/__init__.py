"""Configuration: YAML documents, components, their typed fields, and which code may run."""
