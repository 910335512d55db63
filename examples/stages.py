"""Run the stages of a robot, as the command line does: mesh, samples, model."""

import cfem

for stage, spec in {"mesh": "scene", "sample": "sample", "train": "train"}.items():
    manifest = cfem.run_stage(stage, f"pipelines/bar/{spec}.yaml")
    print(f"{stage}: {manifest['status']} in {manifest['seconds']:.1f} s")
print(*manifest["results"]["headline"], sep="\n")
