"""Load cases of a measured robot: from markers to its parameters, and predictions of cases that nobody measured yet."""
