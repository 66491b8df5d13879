"""The first blocks of a small vision net, trained on photographs and never changed, as features.

`network` runs the net in `net.onnx` by OpenCV, and `features` converts a frame to a vector.
"""
