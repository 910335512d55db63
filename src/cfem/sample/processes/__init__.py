"""Who solves the samples: processes of this machine or workers of a cluster, and how far each is."""
