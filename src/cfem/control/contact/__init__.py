"""The inverse step of a robot that touches something."""
