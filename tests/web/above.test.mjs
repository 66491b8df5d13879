import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.HTMLElement = class {};
globalThis.customElements = { define() {} };
const { begins, way } = await import('../../web/js/components/from-above.js');

test('a flag is marked where it is raised, once each time', () => {
  assert.deepEqual(begins([true, true, false, true, false, false, true, true]), [0, 3, 6]);
  assert.deepEqual(begins([]), []);
});

test('each part of the way is drawn once, in the colour of who drove it', () => {
  let seed = 7;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  for (let round = 0; round < 200; round += 1) {
    const n = Math.floor(random() * 30);
    const pose = Array.from({ length: n }, (_, i) => (random() < 0.9 ? [i, i, 0] : null));
    const driven_by = Array.from({ length: n }, () => ['pilot', 'robot', 'nobody', null][Math.floor(random() * 4)]);
    for (const who of ['pilot', 'robot']) {
      const d = way({ pose, driven_by }, who);
      const drawn = [...d.matchAll(/L(\d+)\.000/g)].map(([, x]) => Number(x));
      const wanted = pose.flatMap((_, i) => (i && pose[i] && pose[i - 1] && driven_by[i] === who ? [i] : []));
      assert.deepEqual(drawn, wanted);
      for (const part of d.split('M').slice(1)) {
        const xs = part.split('L').map((point) => Number(point.split(' ')[0]));
        assert.deepEqual(xs, xs.map((_, i) => xs[0] + i), 'no line leaps over a gap');
      }
    }
  }
});
