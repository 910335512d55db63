"""Sampling that asks the model where it errs: FE states are added there until a stated error is met."""
