"""One self-contained page about a robot: pictures, errors against run time, provenance. Reads artefact folders
only."""
