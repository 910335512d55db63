"""Version of cfem: of this package, its artefacts and its reports."""

VERSION = "0.1.0"
