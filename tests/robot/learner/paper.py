"""The paper's pseudocode as plainly as it can be written: what the fast versions must equal."""

from __future__ import annotations


def squared_distance(a, b):
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True))


class PaperBSOC:
    """Nodes are (image, count, id) in slots without gaps; edges are sorted by weight, then slots."""

    def __init__(self, max_nodes, rounded):
        self.max_nodes = max_nodes
        self.rounded = rounded
        self.nodes = []
        self.next_id = 0

    def lookup(self, x):
        distances = [squared_distance(image, x) for image, _, _ in self.nodes]
        nearest = distances.index(min(distances))
        return nearest, distances[nearest]

    def train(self, x):
        self.nodes.append((list(x), 1, self.next_id))
        self.next_id += 1
        if len(self.nodes) > self.max_nodes:
            edges = [
                (squared_distance(a[0], b[0]) * max(a[1], b[1]), i, j)
                for i, a in enumerate(self.nodes)
                for j, b in enumerate(self.nodes)
                if i < j
            ]
            _, i, j = min(edges)
            self.nodes[i] = self.merged(self.nodes[i], self.nodes[j])
            self.nodes[j] = self.nodes[-1]
            self.nodes.pop()
        return self.lookup(x)[0]

    def merged(self, one, two):
        (n1, c1, id1), (n2, c2, id2) = one, two
        image = [(c1 * p + c2 * q) / (c1 + c2) for p, q in zip(n1, n2, strict=True)]
        if self.rounded:
            image = [int(p + 0.5) for p in image]
        return image, c1 + c2, id1 if c1 >= c2 else id2


class PaperClassifier:
    def __init__(self, max_nodes, rounded=True):
        self.bsoc = PaperBSOC(max_nodes, rounded)
        self.histograms = {}

    def learn(self, x, y):
        before = {node[2]: node for node in self.bsoc.nodes}
        slot = self.bsoc.train(x)
        alive = {node[2] for node in self.bsoc.nodes}
        newest = self.bsoc.next_id - 1
        gone = (set(before) | {newest}) - alive
        if gone:
            (lost,) = gone
            grown = next(
                n[2]
                for n in self.bsoc.nodes
                if n[1] != (before[n[2]][1] if n[2] in before else 1)
            )
            mine = self.histograms.setdefault(grown, {})
            for label, count in self.histograms.pop(lost, {}).items():
                mine[label] = mine.get(label, 0) + count
        histogram = self.histograms.setdefault(self.bsoc.nodes[slot][2], {})
        histogram[y] = histogram.get(y, 0) + 1

    def histogram(self, slot):
        return self.histograms.get(self.bsoc.nodes[slot][2], {})
