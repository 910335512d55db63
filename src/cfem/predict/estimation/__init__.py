"""States and unknown forces estimated from markers and sensors."""
