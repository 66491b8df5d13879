import assert from 'node:assert/strict';
import { test } from 'node:test';

import { EyeLink, encodeEyeFrame } from '../../web/eye/eye-link.js';

class FakeSocket {
  constructor() {
    this.readyState = 1;
    this.sent = [];
    FakeSocket.made.push(this);
  }
  send(data) { this.sent.push(data); }
  close() { this.readyState = 3; }
}

function link() {
  FakeSocket.made = [];
  const timers = new Map();
  let id = 0;
  const environment = {
    WebSocket: FakeSocket, nowMs: () => 1234,
    setTimeout: (f, ms) => { timers.set(++id, { f, ms }); return id; },
    clearTimeout: (n) => timers.delete(n),
  };
  const made = new EyeLink('ws://robot/ws/eye', environment);
  made.connect();
  return { made, timers, socket: () => FakeSocket.made.at(-1) };
}
const hear = (socket, words) => socket.onmessage({ data: JSON.stringify(words) });
const ack = (n) => new Uint8Array([2, 0, 0, 0, n, 0, 0, 0]).buffer;
const picture = new Uint8Array([255, 216, 255]);

test('a picture has a header of 16 bytes, little-endian', () => {
  const view = new DataView(encodeEyeFrame(258, 1.5, true, picture).buffer);
  assert.deepEqual([view.getUint8(0), view.getUint8(1), view.getUint32(4, true), view.getFloat64(8, true), view.byteLength], [3, 1, 258, 1.5, 19]);
});

test('at most two pictures are in flight; an acknowledgement allows one more', () => {
  const { made, socket } = link();
  assert.equal(made.show(picture, 1, false), false, 'nothing is sent before the hello');
  hear(socket(), { type: 'hello' });
  assert.deepEqual([1, 2, 3].map((n) => made.show(picture, n, false)), [true, true, false]);
  socket().onmessage({ data: ack(1) });
  assert.equal(made.show(picture, 4, false), true);
  assert.equal(made.show(picture, 5, false), false);
  assert.equal(socket().sent.length, 3);
});

test('a question about the clock is answered at once', () => {
  const { socket } = link();
  hear(socket(), { type: 'ping', server_ms: 77 });
  assert.deepEqual(JSON.parse(socket().sent[0]), { type: 'pong', server_ms: 77, eye_ms: 1234 });
});

test('the eye reconnects to a silent robot, but not to one that sent it away', () => {
  const { made, timers, socket } = link();
  const events = [];
  for (const name of ['lost', 'closed']) made.addEventListener(name, () => events.push(name));
  [...timers.values()].at(-1).f();
  assert.deepEqual(events, ['lost']);
  [...timers.values()].at(-1).f();
  assert.equal(FakeSocket.made.length, 2, 'the eye reconnects');
  hear(socket(), { type: 'hello' });
  assert.ok(made.hasCredit, 'pictures are allowed again');
  socket().onclose({ code: 4001 });
  assert.deepEqual(events, ['lost', 'closed']);
  assert.equal(timers.size, 0);
});

test('STOP is sent even if no picture may be sent', () => {
  const { made, socket } = link();
  hear(socket(), { type: 'hello' });
  while (made.show(picture, 1, false));
  made.stop();
  assert.deepEqual(JSON.parse(socket().sent.at(-1)), { type: 'stop' });
});

test('a STOP lost on a dead connection is repeated on the next one, until the robot shows that it has stopped', () => {
  const { made, timers, socket } = link();
  const next = () => {
    socket().onclose({ code: 1006 });
    [...timers.values()].at(-1).f();
    hear(socket(), { type: 'hello' });
    return socket().sent.map((text) => JSON.parse(text).type);
  };
  assert.deepEqual(next(), [], 'nobody has pressed it');
  made.stop();
  assert.deepEqual(next(), ['stop'], 'the STOP was lost on the dead connection');
  hear(socket(), { type: 'state', mode: 'stopped', emergency: false });
  assert.deepEqual(next(), ['stop'], 'that state is older than the STOP');
  hear(socket(), { type: 'state', mode: 'stopped', emergency: true });
  assert.deepEqual(next(), [], 'a released robot is not stopped again');
  socket().onclose({ code: 1006 });
  made.stop();
  [...timers.values()].at(-1).f();
  hear(socket(), { type: 'hello' });
  assert.deepEqual(socket().sent.map((text) => JSON.parse(text).type), ['stop'], 'the STOP was pressed without a connection');
});
