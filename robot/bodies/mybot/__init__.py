"""The files that `drivelesson new-driver NAME` writes, with `mybot` in place of NAME."""
