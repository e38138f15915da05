"""Folders that survive crashes and strangers: safe names, atomic files, one writer, a journal."""
