import assert from 'node:assert/strict';
import { test } from 'node:test';

import { readGamepad } from '../../web/js/inputs/gamepad.js';
import { SILENT_MS, Tilt, readTilt } from '../../web/js/inputs/tilt.js';
import { rgbToRgba, yuyvToRgba } from '../../web/js/picture.js';

const pad = (axes, pressed = []) => ({
  axes,
  buttons: Array.from({ length: 17 }, (_, i) => ({ pressed: pressed.includes(i) })),
});

test('a stick drives in its main direction, and must return well towards its middle to stop', () => {
  assert.equal(readGamepad(pad([0.1, -0.2]), null), null);
  assert.equal(readGamepad(pad([0.3, -0.9]), null), 'forward');
  assert.equal(readGamepad(pad([-0.7, 0.1]), null), 'left');
  assert.equal(readGamepad(pad([0.5, 0]), null), null);
  assert.equal(readGamepad(pad([0.5, 0]), 'right'), 'right');
  assert.equal(readGamepad(pad([0.3, 0]), 'right'), null);
});

test('the cross has priority over the stick', () => {
  assert.equal(readGamepad(pad([1, 0], [14]), null), 'left');
});

test('tilt counts from the pose at the touch, however the phone is held', () => {
  const zero = { beta: 40, gamma: 2 };
  const lean = (beta, gamma, angle = 0, before = null) =>
    readTilt({ beta: 40 + beta, gamma: 2 + gamma }, zero, angle, before);
  assert.equal(lean(5, -8), null);
  assert.equal(lean(-20, 0), 'forward');
  assert.equal(lean(0, -20), 'left');
  assert.equal(lean(0, 20), 'right');
  assert.equal(lean(-20, 0, 90), 'left');
  assert.equal(lean(0, 20, 90), 'forward');
  assert.equal(lean(20, 0, 270), 'left');
  assert.equal(lean(0, -11), null);
  assert.equal(lean(0, -11, 0, 'left'), 'left');
});

test('tilt is continuous where a phone stands upright or is held overhead, although the browser’s angles jump there', () => {
  /** Angles as a browser reports them: beta from -180 to 180, gamma from -90 to 90. */
  const told = (beta, gamma) => {
    const [b, g] = gamma >= -90 && gamma < 90 ? [beta, gamma] : [180 - beta, gamma - 180 * Math.sign(gamma)];
    return { beta: b - 360 * Math.floor((b + 180) / 360), gamma: g };
  };
  for (let at = -89; at <= 180; at += 7) {
    for (let by = -35; by <= 35; by += 5) {
      const move = Math.abs(by) < 15 ? [null, null] : by < 0 ? ['forward', 'backward'] : ['backward', 'forward'];
      assert.equal(readTilt(told(at + by, 3), told(at, 0), 0, null), move[0], `${by} from ${at}`);
      if (at >= 90) continue;
      assert.equal(readTilt(told(3, at + by), told(0, at), 270, null), move[0], `on its side, ${by} from ${at}`);
      assert.equal(readTilt(told(3, at + by), told(0, at), 90, null), move[1], `on its other side, ${by} from ${at}`);
    }
  }
});

test('raw pictures are converted to the canvas’s RGBA', () => {
  const rgb = { data: new Uint8Array([1, 2, 3, 4, 5, 6]), width: 2, height: 1 };
  assert.deepEqual([...rgbToRgba(rgb)], [1, 2, 3, 255, 4, 5, 6, 255]);
  const grey = { data: new Uint8Array([16, 128, 235, 128]), width: 2, height: 1 };
  assert.deepEqual([...yuyvToRgba(grey)], [0, 0, 0, 255, 255, 255, 255, 255]);
  const red = { data: new Uint8Array([81, 90, 81, 240]), width: 2, height: 1 };
  const [r, g, b] = yuyvToRgba(red);
  assert.ok(r > 250 && g < 5 && b < 5, `${r} ${g} ${b}`);
});

test('a silent tilt sensor stops the robot', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  const listeners = {};
  Object.assign(globalThis, {
    addEventListener: (type, act) => (listeners[type] = act), removeEventListener: (type) => delete listeners[type], screen: {},
  });
  const done = [];
  const tilt = new Tilt({ grasp() {}, press: (_, move) => done.push(move), release: () => done.push(null) });
  tilt.hold();
  listeners.deviceorientation({ beta: 40, gamma: 0 });
  listeners.deviceorientation({ beta: 10, gamma: 0 });
  assert.equal(done.at(-1), 'forward');
  context.mock.timers.tick(SILENT_MS - 1);
  assert.equal(done.at(-1), 'forward');
  context.mock.timers.tick(1);
  assert.equal(done.at(-1), null);
  listeners.deviceorientation({ beta: 10, gamma: 0 });
  assert.equal(done.at(-1), 'forward', 'new readings drive again');
  tilt.letGo();
  assert.equal(done.at(-1), null);
  assert.deepEqual(listeners, {});
});

test('tilt also works on a phone that has only the older name of the screen’s orientation', () => {
  for (const [screen, orientation] of [[{ orientation: { angle: 90 } }, undefined], [{ orientation: { angle: 270 } }, undefined], [{}, 90], [{}, -90]]) {
    Object.assign(globalThis, { addEventListener() {}, removeEventListener() {}, screen, orientation });
    const done = [];
    const tilt = new Tilt({ grasp() {}, press: (_, move) => done.push(move), release() {} });
    tilt.hold();
    tilt.follow({ beta: 40, gamma: 0 });
    tilt.follow({ beta: 20, gamma: 0 });
    assert.deepEqual(done, [(screen.orientation?.angle ?? orientation) === 90 ? 'left' : 'right']);
    tilt.letGo();
  }
  delete globalThis.orientation;
});

test('the page requests permission for tilt when the finger is lifted', async () => {
  let asked = 0;
  Object.assign(globalThis, {
    addEventListener() {}, removeEventListener() {}, isSecureContext: true, screen: {},
    DeviceOrientationEvent: { requestPermission: async () => ((asked += 1), 'granted') },
  });
  const tilt = new Tilt({ grasp() {}, press() {}, release() {} });
  tilt.hold();
  assert.equal(asked, 0, 'browsers refuse the request while the finger goes down');
  tilt.letGo();
  assert.equal(asked, 1);
  tilt.hold();
  tilt.follow({ beta: 40, gamma: 0 });
  tilt.letGo();
  assert.equal(asked, 1, 'the permission was granted');
});
