"""Find the actuation that brings the tip to a goal (after examples/stages.py)."""

import cfem

model = cfem.load_model("models/bar/spectral")
goal = model.rest_e + model.at_displacement([4.0]).delta_e
found = cfem.find_actuation(model, goal)
print(f"goal {goal} mm: cable {found.delta_a} mm, {found.distance:.1e} mm remain; {found.status.value}")
step = cfem.inverse_step(model, model.at_displacement([0.0]), goal, step=1.0)
print(f"the first step alone, of at most 1 mm: {step.delta_a} mm")
