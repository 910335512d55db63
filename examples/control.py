"""Control the finite-element robot with the learned model, tick by tick (after examples/stages.py)."""

import cfem

model = cfem.load_model("models/bar/spectral")
plant = cfem.FemPlant(cfem.load_robot("pipelines/bar/scene.yaml", "data/bar/mesh"))
controller = cfem.make_controller(model, gains=(0.0, 0.3), rate=1.0)
goal, measured = model.rest_e + model.at_displacement([4.0]).delta_e, None
for tick in range(8):
    measured = plant.step(controller.tick(goal, measured).u)
    print(f"tick {tick + 1}: cable {measured.delta_a} mm, tip {abs(measured.x_e - goal).max():.1e} mm from the goal")
