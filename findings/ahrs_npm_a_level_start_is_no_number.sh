#!/usr/bin/env bash
# ahrs 1.3.3 (npm): a robot that is exactly level at its first reading has no heading for the rest of the session.
#
# Guess before running: with the Madgwick filter, a level robot (acceleration 0, 0, 1) that turns by 1 rad has a
# heading of 1 rad, and one that does not turn has a heading of 0, with or without a compass.
# Outcome: wrong. If the first acceleration points exactly in the expected direction, the length of the filter's
# correction is 0, and the filter divides by it. All angles become NaN and stay NaN with every later reading; no error
# is raised. A simulated robot on a floor gives such a first reading, and so does a sensor that rounds or that was
# calibrated. If the first reading is 0.01 off, the heading is 1.00, even if level readings follow. The Mahony filter
# is right in both cases.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund --ignore-scripts ahrs@1.3.3
cat > run.cjs <<'JS'
const assert = require("node:assert");
const AHRS = require("ahrs");

const READINGS = 50; // of 20 ms each, thus 1 s at 1 rad/s
const level = [0, 0, 1, 0, 0, 1];
const tilted = [0, 0, 1, 0.01, 0, 1];

/** Return the heading after turning by 1 rad. */
function heading(algorithm, first, later) {
  const filter = new AHRS({ sampleInterval: 20, algorithm });
  filter.update(...first);
  for (let i = 1; i < READINGS; i++) filter.update(...later);
  return filter.getEulerAngles().heading;
}

const found = {};
for (const algorithm of ["Mahony", "Madgwick"]) {
  found[algorithm] = [
    heading(algorithm, level, level),
    heading(algorithm, level, tilted),
    heading(algorithm, tilted, tilted),
    heading(algorithm, tilted, level),
  ];
  const [all, first, none, rest] = found[algorithm].map((angle) => angle.toFixed(2));
  console.log(`${algorithm}: always level ${all}, level at first ${first}, never ${none}, after the first ${rest}`);
}
const isOne = (angle) => Math.abs(angle - 1) < 0.01;
assert.ok(found.Mahony.every(isOne));
assert.deepEqual(found.Madgwick.map(Number.isNaN), [true, true, false, false]);
assert.ok(found.Madgwick.slice(2).every(isOne));
JS
node run.cjs
