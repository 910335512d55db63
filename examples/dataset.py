"""Read the states that were sampled (after examples/stages.py)."""

import cfem

train, test = (cfem.read_dataset("data/bar/samples", split) for split in ("train", "test"))
print(f"{len(train)} training and {len(test)} test states, {train.failed.num_rows} failed")
print(f"cable displacements from {train.delta_a.min():.2f} to {train.delta_a.max():.2f} mm")
print(f"W of the first state, rows {train.rows.names}:\n{train.W[0]}")
