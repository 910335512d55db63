"""A trained model in the formats that others run: arrays, ONNX, TorchScript, C."""
