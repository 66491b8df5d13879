"""The figures of the paper (FLAIRS-30, 2017), to compare with ours."""

from __future__ import annotations

FIGURE_3 = {
    "knn-3": (609.5, 46.1),
    "knn-9": (624.4, 36.1),
    "published-32": (601.1, 52.0),
    "published-64": (614.5, 40.5),
    "published-128": (616.1, 36.6),
}
"""Frames of 700 rightly classified: mean and standard deviation."""

FIGURE_5_LEARNING_HZ = {2: 14.90, 4: 14.52, 8: 13.24, 16: 11.26, 32: 7.13, 64: 4.0}
FIGURE_5_APPLYING_HZ = {2: 12.16, 4: 9.61, 8: 6.59, 16: 4.03, 32: 2.33, 64: 1.57}
"""Cycles a second on the EV3, by number of nodes."""

FIGURE_6 = {
    2: (31.74, 17.28),
    4: (11.62, 10.36),
    8: (4.40, 7.68),
    16: (2.87, 4.34),
    32: (3.48, 5.84),
    64: (12.20, 10.57),
}
"""SSD by number of nodes, self-trained by sonar: mean and standard deviation."""

FIGURE_7 = {
    1: {"before": (9.40, 12.95, 44.90), "after": (1.77, 1.77, 6.96)},
    2: {"before": (14.24, 12.15, 46.76), "after": (1.72, 1.93, 7.50)},
    3: {"before": (20.47, 16.42, 65.56), "after": (10.84, 15.21, 86.79)},
}
"""SSD by trial, 32 nodes, human teachers: mean, standard deviation, maximum."""

FIGURE_8 = {("robot", 90): 12.41, ("robot", 180): 8.21, ("human", 90): 11.79, ("human", 180): 9.38}
"""Mean SSD by teacher and seconds of training."""
