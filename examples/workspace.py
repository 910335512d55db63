"""Many states of a learned model at once, their Jacobian, and the workspace (after examples/stages.py)."""

import cfem

model = cfem.load_model("models/bar/spectral")
print(model)
states = model.at_displacement([[2.0], [4.0], [6.0]])
print(f"three states, the tip's places (mm from rest):\n{states.delta_e.round(3)}")
print(f"d tip / d cable at the second: {model.jacobian(states)[1].ravel().round(3)}")

space = model.workspace(200)
print(f"the tip goes from {space.x_e.min(axis=0).round(2)} to {space.x_e.max(axis=0).round(2)} mm")
space.plot().savefig("workspace.png")
