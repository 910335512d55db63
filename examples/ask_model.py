"""Ask a learned model where the robot goes (after examples/stages.py)."""

import cfem

model = cfem.load_model("models/bar/spectral")
state = model.at_displacement([5.0])
print(f"cable 5 mm shorter: tip moves by {state.delta_e} mm, cable force {state.lambda_a} N")
print(f"the same force moves the tip by {model.at_force(state.lambda_a).delta_e} mm")
print(f"within the training states: {model.inside(state)}")
