"""From what laboratories record (camera systems' exports) to a table of load cases."""
