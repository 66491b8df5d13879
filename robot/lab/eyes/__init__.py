"""Features from the first blocks of a small vision net that was trained on photographs and is never
changed.

`network` runs the net in `net.onnx` by OpenCV, and `features` converts a frame to a vector.
"""
