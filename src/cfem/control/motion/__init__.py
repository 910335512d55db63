"""Controllers that know how the robot moves: model predictive control, its observer, input shaping, feed-forward."""
