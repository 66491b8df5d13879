"""The paper's pseudocode as plain code, whose results the fast versions must equal."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Node:
    image: list
    count: int
    name: int
    histogram: Counter = field(default_factory=Counter)


def squared_distance(a, b):
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True))


class PaperBSOC:
    """Nodes are in slots without gaps; edges are sorted by weight, then by the slots of their
    ends."""

    def __init__(self, max_nodes, rounded):
        self.max_nodes = max_nodes
        self.rounded = rounded
        self.nodes = []
        self.n_seen = 0

    def lookup(self, x):
        distances = [squared_distance(node.image, x) for node in self.nodes]
        nearest = distances.index(min(distances))
        return nearest, distances[nearest]

    def train(self, x, y=None):
        self.nodes.append(Node(list(x), 1, self.n_seen))
        self.n_seen += 1
        if len(self.nodes) > self.max_nodes:
            edges = [
                (squared_distance(a.image, b.image) * max(a.count, b.count), i, j)
                for i, a in enumerate(self.nodes)
                for j, b in enumerate(self.nodes)
                if i < j
            ]
            _, i, j = min(edges)
            self.nodes[i] = self.merged(self.nodes[i], self.nodes[j])
            self.nodes[j] = self.nodes[-1]
            self.nodes.pop()
        slot = self.lookup(x)[0]
        if y is not None:
            self.nodes[slot].histogram[y] += 1
        return slot

    def merged(self, one, two):
        total = one.count + two.count
        image = [
            (one.count * p + two.count * q) / total
            for p, q in zip(one.image, two.image, strict=True)
        ]
        if self.rounded:
            image = [int(p + 0.5) for p in image]
        name = one.name if one.count >= two.count else two.name
        return Node(image, total, name, one.histogram + two.histogram)
