"""Objects found by a network from the user's ONNX file."""
