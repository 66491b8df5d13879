"""The first blocks of a small vision net, trained on photographs and never changed, as features.

`network` has OpenCV run the net in `net.onnx`, and `features` turns a frame into a vector.
"""
