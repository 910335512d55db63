"""The robot as one page that runs in a browser."""
