// The whole page of the eye, with a camera, a worker and a robot that fail.
import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { wordsOf } from './words.mjs';

const en = await wordsOf('en');
const elements = {};
class FakeElement extends EventTarget {
  dataset = {};
  textContent = '';
  hidden = false;
  srcObject = null;
  videoWidth = 640;
  videoHeight = 480;
  get readyState() { return this.srcObject ? 4 : 0; }
  async play() {}
}
const picture = async () => ({ arrayBuffer: async () => new ArrayBuffer(3) });
class FakeCanvas {
  getContext() { return { drawImage() {}, getImageData: () => ({ data: [200, 200, 200, 255] }) }; }
  toBlob(done) { picture().then(done); }
}
class FakeSocket {
  static all = [];
  readyState = 1;
  sent = [];
  constructor() { FakeSocket.all.push(this); }
  send(data) { this.sent.push(data); }
  close() { this.readyState = 3; }
}
class FakeWorker extends EventTarget {
  static last;
  constructor() { super(); FakeWorker.last = this; }
  postMessage(data) { this.asked = data; }
}
class FakeTrack {
  isStopped = false;
  stop() { this.isStopped = true; }
}
const tracks = [];
const asked = [];
let robot = async () => ({ ok: true, json: async () => ({}) });
const place = { reloads: 0, reload: () => (place.reloads += 1) };
Object.defineProperty(globalThis, 'navigator', { configurable: true, value: { languages: ['en'], mediaDevices: {
  getUserMedia: async () => { const track = new FakeTrack(); tracks.push(track); return { getTracks: () => [track] }; },
} } });
/** The window's key listeners, in the order of registration. @type {[string, Function][]} */
const keys = [];
Object.assign(globalThis, {
  window: globalThis, HTMLElement: class {}, addEventListener: (type, act) => keys.push([type, act]), OffscreenCanvas: FakeCanvas, Worker: FakeWorker, WebSocket: FakeSocket, location: place,
  createImageBitmap: async () => ({}),
  document: {
    baseURI: 'https://robot/eye', documentElement: {}, body: { dataset: {} }, visibilityState: 'visible', addEventListener() {},
    getElementById: (id) => (elements[id] ??= new FakeElement()), createElement: () => new FakeCanvas(),
  },
  fetch: (path, { method }) => { asked.push(`${method} ${path}`); return robot(); },
});

mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
test.after(() => mock.timers.reset());
const soon = () => new Promise(setImmediate);
async function pass(ms) {
  for (let gone = 0; gone < ms; gone += 50) {
    mock.timers.tick(50);
    await soon();
  }
}
const socket = () => FakeSocket.all.at(-1);
const hear = (words) => socket().onmessage({ data: JSON.stringify(words) });
const pictures = () => FakeSocket.all.flatMap(({ sent }) => sent).filter((one) => typeof one !== 'string').length;
/** Acknowledge all pictures, so that the page may send more. */
const acknowledge = () => socket().onmessage({ data: new Uint8Array([2, 0, 0, 0, socket().sent.length, 0, 0, 0]).buffer });

await import('../../web/eye/eye.js');
await soon();

test('the page encodes the pictures if the worker cannot', async () => {
  hear({ type: 'hello', width: 320, height: 240, rate_hz: 15 });
  await pass(200);
  assert.ok(FakeWorker.last.asked.bitmap, 'the worker was asked first');
  assert.equal(pictures(), 0);
  FakeWorker.last.onmessage({ data: null });
  await pass(200);
  assert.ok(pictures() > 0, 'the page sends pictures');
});

test('the worker reports that it cannot encode', async () => {
  const [heard, said] = [[], []];
  Object.assign(globalThis, { addEventListener: (_, act) => heard.push(act), postMessage: (data) => said.push(data) });
  FakeCanvas.prototype.convertToBlob = async () => { throw new Error('EncodingError'); };
  await import('../../web/eye/eye-worker.js');
  await heard[0]({ data: { bitmap: { width: 4, height: 3, close() {} }, to: { width: 4, height: 3 } } });
  delete FakeCanvas.prototype.convertToBlob;
  assert.deepEqual(said, [null]);
});

test('a lost camera sends no picture, not even its last one; after its return, only one loop takes pictures', async () => {
  acknowledge();
  await pass(200);
  const before = pictures();
  tracks.at(-1).onended();
  for (let i = 0; i < 5; i += 1) {
    acknowledge();
    await pass(100);
  }
  assert.equal(pictures(), before);
  assert.ok(tracks[0].isStopped && !elements.begin.hidden);
  const timers = mock.method(globalThis, 'setTimeout');
  await pass(1000);
  const once = timers.mock.callCount();
  elements.begin.dispatchEvent(new Event('click'));
  await soon();
  timers.mock.resetCalls();
  await pass(1000);
  assert.ok(timers.mock.callCount() < 1.5 * once + 10, 'the page takes pictures as often as before');
  timers.mock.restore();
});

for (const [name, key] of [['NotFoundError', 'eye.none'], ['NotReadableError', 'eye.in_use'], ['NotAllowedError', 'eye.refused']]) {
  test(`an eye without a camera says why: ${name}`, async () => {
    const { getUserMedia } = navigator.mediaDevices;
    navigator.mediaDevices.getUserMedia = async () => { throw Object.assign(new Error(), { name }); };
    elements.begin.dispatchEvent(new Event('click'));
    await soon();
    assert.equal(elements.said.textContent, en[key]);
    navigator.mediaDevices.getUserMedia = getUserMedia;
    elements.begin.dispatchEvent(new Event('click'));
    await soon();
  });
}

test('the page repeats STOP requests until the robot obeys, even if another phone has the websocket', async () => {
  socket().onclose({ code: 4001 });
  robot = async () => { throw new TypeError('away'); };
  asked.length = 0;
  for (const type of ['pointerdown', 'click']) elements.stop.dispatchEvent(new Event(type));
  await pass(3000);
  assert.ok(asked.length > 4 && asked.length < 20, `${asked.length} requests`);
  robot = async () => ({ ok: true, json: async () => ({}) });
  await pass(1000);
  const heard = asked.length;
  await pass(5000);
  assert.equal(asked.length, heard, 'no request follows');
  assert.deepEqual([...new Set(asked)], ['POST api/stop']);
});

test('a key stops the robot wherever the focus is, and presses a button while the robot stands', async () => {
  elements.begin.dispatchEvent(new Event('click'));
  await soon();
  const press = (key, target) => {
    let isOver = false;
    const event = { key, target, preventDefault: () => (event.defaultPrevented = true), stopPropagation: () => (isOver = true) };
    for (const [type, act] of keys) if (type === 'keydown' && !isOver) act(event);
    return event.defaultPrevented === true;
  };
  const stops = () => socket().sent.filter((one) => one.includes?.('stop')).length;
  for (const [mode, felt] of [['train', [true, true, true, false]], ['autonomous', [true, true, true, false]], ['stopped', [false, false, false, false]]]) {
    hear({ type: 'state', mode, driven_by: 'nobody', emergency: false });
    assert.deepEqual([' ', 'MediaStop', 'Escape', 'Enter'].map((key) => press(key, elements.begin)), felt, mode);
  }
  assert.equal(stops(), 6);
});

test('an eye that is no longer paired goes to the pairing page', async () => {
  robot = async () => ({ ok: false, status: 403, json: async () => ({}) });
  elements.begin.dispatchEvent(new Event('click'));
  await soon();
  socket().onclose({ code: 1006 });
  await pass(100);
  assert.equal(place.reloads, 0);
  robot = async () => ({ ok: false, status: 401, json: async () => ({ detail: 'not admitted' }) });
  await pass(500);
  socket().onclose({ code: 1006 });
  await pass(100);
  assert.equal(place.reloads, 1);
});
