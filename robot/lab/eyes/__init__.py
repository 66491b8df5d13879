"""The first blocks of a small vision net, trained on photographs and never changed, as features.

`weights` reads the trained numbers, `network` makes of them a net that OpenCV runs, `onnx_writer`
writes it down in a form that OpenCV reads, and `features` turns a frame into a vector.
"""
