"""Artefact folders: manifests, hashes, whether they are up to date, how one takes the place of another."""
