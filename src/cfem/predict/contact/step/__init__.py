"""One step of contact: robots among obstacles and each other, round by round."""
