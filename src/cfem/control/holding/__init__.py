"""Objects held between robots: grasp, squeeze, lift, put down."""
