"""Control over time with feedback: controller, tick, late samples, estimated states, plants, results."""
