"""Run the stages of a robot, as the command line does: mesh, samples, model."""

import cfem

done = cfem.run_folder("pipelines/bar", until="train")
for one in done["results"]["stages"]:
    print(f"{one['stage']}: {one['status']}; {', '.join(one['why'])}")
manifest = cfem.run_stage("train", "pipelines/bar/train.yaml")  # one stage: up to date by now
print(manifest["status"], *manifest["results"]["headline"], sep="\n")
