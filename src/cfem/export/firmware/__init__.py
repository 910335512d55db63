"""A trained model as C: the sources that are the same for every robot, and the numbers of this one."""
