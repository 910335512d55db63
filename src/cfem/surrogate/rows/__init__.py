"""Models of modules in a row, from trained models of one."""
