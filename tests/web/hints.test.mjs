import assert from 'node:assert/strict';
import { test } from 'node:test';

import { HINTS, hintNow } from '../../web/js/hints.js';

const visit = (moments) => {
  const shown = [];
  const seen = [];
  for (const moment of moments) {
    const hint = hintNow(moment, shown);
    if (hint) { seen.push(hint); shown.push(hint); }
  }
  return seen;
};

test('each hint is shown once, at the right moment', () => {
  const stopped = { mode: 'stopped', lessons: 0 };
  const first = { mode: 'train', lessons: 3 };
  const taught = { mode: 'train', lessons: 90 };
  const alone = { mode: 'autonomous', lessons: 90 };
  assert.deepEqual(visit([stopped, stopped, first, taught, taught, alone, alone, stopped]), HINTS);
  assert.deepEqual(visit([alone]), ['correct']);
});

test('each hint is about the current situation', () => {
  for (const mode of ['stopped', 'train', 'autonomous']) {
    for (const lessons of [0, 1, 59, 60, 5000]) {
      const hint = hintNow({ mode, lessons }, []);
      if (hint === 'teach') assert.ok(mode === 'stopped' && lessons === 0);
      if (hint === 'bars') assert.equal(mode, 'train');
      if (hint === 'correct') assert.equal(mode, 'autonomous');
    }
  }
});
