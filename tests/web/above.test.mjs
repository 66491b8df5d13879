import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.HTMLElement = class {};
globalThis.customElements = { define() {} };
globalThis.ResizeObserver = class {};
const { begins, way } = await import('../../web/js/components/from-above.js');
const { Way } = await import('../../web/js/components/drive-map.js');

test('each run of set flags is marked once, at its beginning', () => {
  assert.deepEqual(begins([true, true, false, true, false, false, true, true]), [0, 3, 6]);
  assert.deepEqual(begins([]), []);
});

test('each part of the path is drawn once, in the colour of its driver', () => {
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
        assert.deepEqual(xs, xs.map((_, i) => xs[0] + i), 'no line crosses a gap');
      }
    }
  }
});

test('a path that arrives in parts equals the whole path, whatever the robot has dropped meanwhile', () => {
  let seed = 11;
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
  const MOST = 40; // number of points that the robot keeps
  for (let round = 0; round < 100; round += 1) {
    const known = new Way();
    let kept = [];
    let n = 0;
    for (let turn = 0; turn < 60; turn += 1) {
      if (random() < 0.03) {
        kept = [];
        n += 1;
      }
      for (let i = Math.floor(random() * 30); i > 0; i -= 1) {
        kept.push({ pose: [n, 0, 0], by: random() < 0.5 ? 'pilot' : 'robot', events: random() < 0.1 ? ['asked'] : [] });
        n += 1;
      }
      kept = kept.slice(-MOST);
      const first = n - kept.length;
      const start = known.next >= first && known.next <= n ? known.next : first;
      const points = kept.slice(start - first);
      known.add({
        first: start, pose: points.map(({ pose }) => pose), driven_by: points.map(({ by }) => by), is_estimate: false,
        events: Object.fromEntries(points.flatMap(({ events }, i) => (events.length ? [[String(i), events]] : []))),
      });
      assert.deepEqual(known.pose.slice(-kept.length || known.pose.length), kept.map(({ pose }) => pose));
      assert.equal(known.pose.length, known.driven_by.length);
      for (const { at } of known.events) assert.ok(known.pose[at], 'each event has a pose');
      const marked = known.events.map(({ at }) => known.pose[at][0]);
      for (const { pose, events } of kept) assert.equal(marked.includes(pose[0]), events.length > 0);
    }
  }
});

test('a page that stays open for a whole lesson stores no more of the path than the robot does', () => {
  const known = new Way();
  for (let n = 0; n < 9000; n += 30) {
    const pose = Array.from({ length: 30 }, (_, i) => [n + i, 0, 0]);
    assert.equal(known.next, n);
    known.add({ first: n, pose, driven_by: pose.map(() => 'pilot'), events: { 7: ['asked'] }, is_estimate: false });
  }
  assert.equal(known.pose.length, 2000);
  assert.equal(known.driven_by.length, 2000);
  assert.deepEqual(known.events.map(({ at }) => known.pose[at][0] % 30), known.events.map(() => 7));
  assert.equal(known.events.length, known.pose.filter(([x]) => x % 30 === 7).length);
});
