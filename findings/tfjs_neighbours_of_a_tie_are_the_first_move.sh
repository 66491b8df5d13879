#!/usr/bin/env bash
# @tensorflow-models/knn-classifier 1.2.6 (npm, tfjs 4.22.0): with one example for each move, each picture gets the
# first move.
#
# Guess before running: a classifier that has learned one picture per move answers an identical picture with its move,
# because the nearest neighbour counts most. The README's own example adds one example to each class.
# Outcome: wrong. By default predictClass asks 3 neighbours, or all if there are fewer, and each has the same vote.
# With two or three moves this is a tie, in which the move that was taught first wins, with a confidence of 1/2 or
# 1/3: at a picture for "right" the robot goes left. With three examples of each move, or k = 1, all answers are
# right. The classifier compares directions, not lengths: a picture with a tenth of the light is identical.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @tensorflow-models/knn-classifier@1.2.6 \
  @tensorflow/tfjs-core@4.22.0 @tensorflow/tfjs-backend-cpu@4.22.0
cat > taught.cjs <<'JS'
const { setBackend, tensor1d } = require('@tensorflow/tfjs-core');
require('@tensorflow/tfjs-backend-cpu');
const { create } = require('@tensorflow-models/knn-classifier');

const VIEWS = { left: [0.9, 0.1, 0.1], right: [0.1, 0.9, 0.1], ahead: [0.1, 0.1, 0.9] };

async function answers(moves, examples, k) {
  const classifier = create();
  for (let i = 0; i < examples; i++) for (const move of moves) classifier.addExample(tensor1d(VIEWS[move]), move);
  const given = [];
  for (const move of moves) given.push((await classifier.predictClass(tensor1d(VIEWS[move]), k)).label);
  return given.join(' ');
}

async function look() {
  await setBackend('cpu');
  const three = Object.keys(VIEWS);
  const found = [await answers(['left', 'right'], 1), await answers(three, 1), await answers(three, 3)];
  found.push(await answers(three, 1, 1));
  const classifier = create();
  classifier.addExample(tensor1d([0.9, 0.9, 0.9]), 'lamp on');
  classifier.addExample(tensor1d([0.09, 0.09, 0.09]), 'lamp off');
  found.push((await classifier.predictClass(tensor1d([0.09, 0.09, 0.09]), 1)).label);
  console.log(JSON.stringify(found));
  const expected = ['left left', 'left left left', 'left right ahead', 'left right ahead', 'lamp on'];
  process.exit(JSON.stringify(found) === JSON.stringify(expected) ? 0 : 1);
}
look();
JS
node taught.cjs
