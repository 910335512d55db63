"""Sections of the report, each from one kind of artefact."""
