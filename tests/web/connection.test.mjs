import assert from 'node:assert/strict';
import { beforeEach, test } from 'node:test';

import { Connection } from '../../web/js/connection.js';
import { encodePicture } from '../../web/js/protocol.js';

/** A socket that a test opens, feeds and cuts. */
class FakeSocket {
  static all = [];

  constructor(url) {
    this.url = url;
    this.sent = [];
    this.readyState = 0;
    FakeSocket.all.push(this);
  }

  open() {
    this.readyState = 1;
    this.onopen?.();
  }

  send(message) {
    this.sent.push(message);
  }

  close() {
    this.readyState = 3;
  }
}

/** Timers that run when a test says so. */
class FakeTime {
  nowMs = 0;
  timers = new Map();
  next = 1;

  setTimeout = (act, ms) => {
    this.timers.set(this.next, { at: this.nowMs + ms, act });
    return this.next++;
  };

  clearTimeout = (id) => this.timers.delete(id);

  forward(ms) {
    const end = this.nowMs + ms;
    for (;;) {
      const due = [...this.timers].filter(([, t]) => t.at <= end).sort((a, b) => a[1].at - b[1].at)[0];
      if (!due) break;
      this.timers.delete(due[0]);
      this.nowMs = due[1].at;
      due[1].act();
    }
    this.nowMs = end;
  }
}

let time;
let connection;
let events;
let isHidden;
const latest = (path) => FakeSocket.all.filter((s) => s.url.endsWith(path)).at(-1);

beforeEach(() => {
  FakeSocket.all = [];
  time = new FakeTime();
  connection = new Connection('ws://robot', {
    WebSocket: FakeSocket,
    nowMs: () => time.nowMs,
    setTimeout: time.setTimeout,
    clearTimeout: time.clearTimeout,
    isHidden: () => isHidden,
  });
  isHidden = false;
  events = [];
  for (const type of ['open', 'lost', 'words', 'picture']) {
    connection.addEventListener(type, (event) => events.push([type, event.detail]));
  }
  connection.connect();
});

test('pictures have a separate websocket, which opens after the one for messages', () => {
  assert.deepEqual(FakeSocket.all.map((s) => s.url), ['ws://robot/ws/drive']);
  latest('/ws/drive').open();
  latest('/ws/video').open();
  const picture = { frameId: 7, capturedMs: 3, encoding: 'rgb', width: 1, height: 1, quiet: false, nonce: 5, data: new Uint8Array(3) };
  latest('/ws/video').onmessage({ data: encodePicture(picture) });
  assert.deepEqual(events.at(-1), ['picture', picture]);
  connection.acknowledge(7);
  assert.equal(latest('/ws/video').sent.length, 1);
});

for (const [what, order] of [['after', ['open', 'ready']], ['before', ['ready', 'open']]]) {
  test(`the link opens immediately, and the pictures once the painter is known, ${what} the link is open`, async () => {
    FakeSocket.all = [];
    let know;
    const begun = connection.begin(new Promise((resolve) => (know = resolve)));
    const acts = { open: () => FakeSocket.all[0].open(), ready: async () => { know(); await begun; } };
    for (const [i, act] of order.entries()) {
      assert.deepEqual(FakeSocket.all.map(({ url }) => url.slice(-6)), ['/drive'], `before step ${i}`);
      await acts[act]();
    }
    assert.deepEqual(FakeSocket.all.map(({ url }) => url.slice(-6)), ['/drive', '/video']);
    connection.close();
  });
}

test('a silent link counts as lost, and a new link sends no old message', () => {
  latest('/ws/drive').open();
  connection.nextSeq();
  assert.equal(connection.nextSeq(), 2);
  time.forward(1000);
  latest('/ws/drive').onmessage({ data: '{"type":"state"}' });
  time.forward(1400);
  assert.deepEqual(events.map(([type]) => type), ['open', 'words']);
  time.forward(200);
  assert.equal(events.at(-1)[0], 'lost');
  assert.equal(connection.send('late'), false);
  time.forward(300);
  latest('/ws/drive').open();
  const said = latest('/ws/drive').sent.map((text) => JSON.parse(text).type);
  assert.deepEqual(said, ['ping']);
  assert.equal(connection.nextSeq(), 1);
});

test('the page retries a robot that does not answer less and less often', () => {
  for (const wait of [250, 500, 1000, 2000, 2000]) {
    const before = FakeSocket.all.length;
    latest('/ws/drive').onclose();
    time.forward(wait - 1);
    assert.equal(FakeSocket.all.length, before);
    time.forward(1);
    assert.equal(FakeSocket.all.length, before + 1);
  }
});

test('a hidden page does not reconnect after it has lost its link, but does so at once when it is visible', () => {
  latest('/ws/drive').open();
  isHidden = true;
  latest('/ws/drive').onclose();
  time.forward(10 * 60_000);
  assert.equal(FakeSocket.all.filter((socket) => socket.readyState < 2).length, 0);
  isHidden = false;
  connection.seek();
  latest('/ws/drive').open();
  time.forward(1000);
  connection.seek();
  const open = FakeSocket.all.filter((socket) => socket.readyState < 2);
  assert.deepEqual(open.map(({ url }) => url), ['ws://robot/ws/drive', 'ws://robot/ws/video']);
});

test('if a person has more tabs than slots, the visible tab keeps its link and the tabs do not evict one another in turn', () => {
  const places = 3;
  const tabs = [];
  const sockets = () => FakeSocket.all.filter((socket) => socket.readyState < 2 && socket.url.endsWith('/ws/drive'));
  const settle = () => sockets().forEach((socket) => {
    if (socket.readyState === 0) socket.open();
    socket.onmessage({ data: '{"type":"hello"}' });
    if (sockets().length > places) { // like a robot, which evicts the oldest
      const [first] = sockets();
      first.readyState = 3;
      first.onclose();
    }
  });
  connection.close();
  for (let i = 0; i < 6; i += 1) {
    const tab = new Connection('ws://robot', { ...connection.env, isHidden: () => i > 0 });
    tabs.push(tab);
    tab.connect();
    settle();
  }
  for (let s = 0; s < 20; s += 1) {
    time.forward(250);
    settle();
  }
  let lost = 0;
  for (const tab of tabs) tab.addEventListener('lost', () => (lost += 1));
  for (let s = 0; s < 40; s += 1) {
    time.forward(250);
    settle();
  }
  assert.ok(tabs[0].isOpen);
  assert.equal(lost, 0);
});

test('the fastest answer determines the offset of the clocks', () => {
  latest('/ws/drive').open();
  const pong = (sentMs, backMs, serverMs) => {
    time.nowMs = backMs;
    latest('/ws/drive').onmessage({ data: JSON.stringify({ type: 'pong', client_ms: sentMs, server_ms: serverMs }) });
  };
  assert.equal(connection.ageMs(0), null);
  pong(100, 300, 5000); // a round trip of 200 ms, answered at 200 by our clock: 4800 ahead
  assert.equal(connection.ageMs(5000), 100);
  pong(400, 410, 5205); // a round trip of 10 ms: the same offset, but more exact
  pong(500, 900, 5900); // a slow answer changes nothing
  assert.equal(connection.delayMs, 400);
  assert.equal(connection.ageMs(5600), 100);
});

test('a video websocket that closes by itself is opened again', () => {
  latest('/ws/drive').open();
  latest('/ws/video').open();
  latest('/ws/video').onclose();
  time.forward(250);
  assert.equal(FakeSocket.all.filter((s) => s.url.endsWith('/ws/video')).length, 2);
});

test('a video websocket that hangs is replaced as long as newer pictures exist', () => {
  const videos = () => FakeSocket.all.filter((s) => s.url.endsWith('/ws/video'));
  const live = (ms, frameAt) => {
    for (let gone = 0; gone < ms; gone += 100) {
      time.forward(100);
      latest('/ws/drive').onmessage({ data: JSON.stringify({ type: 'state', frame: frameAt(gone) }) });
    }
  };
  latest('/ws/drive').open();
  latest('/ws/video').open();
  connection.noteShown({ frame: 7, nonce: 5 });
  live(20_000, () => 7);
  assert.equal(videos().length, 1, 'a frozen camera has no newer pictures');
  live(4000, (gone) => 8 + gone);
  connection.noteShown({ frame: 9, nonce: 5 });
  live(4000, (gone) => 50 + gone);
  assert.equal(videos().length, 1, 'the page waits for a slow websocket');
  live(2000, (gone) => 5000 + gone);
  assert.equal(videos().length, 2);
  assert.equal(videos()[0].readyState, 3);
  live(6000, (gone) => 9000 + gone);
  assert.equal(videos().length, 3, 'the next one is replaced, too');
  connection.showPictures(false);
  live(20_000, (gone) => 20_000 + gone);
  assert.equal(videos().length, 3, 'no pictures are wanted');
});

test('a command carries the nonce that arrived last, even if an older picture is drawn later', () => {
  const state = (nonce) => latest('/ws/drive').onmessage({ data: JSON.stringify({ type: 'state', nonce }) });
  const draw = (nonce, arrivedMs) => connection.noteShown({ frame: nonce, capturedMs: 0, arrivedMs, nonce });
  latest('/ws/drive').open();
  time.forward(100);
  draw(11, 90);
  assert.equal(connection.nonce, 11);
  state(12);
  time.forward(400);
  draw(13, 60);
  assert.equal(connection.nonce, 12, 'a nonce from 440 ms ago is too old: the robot would refuse even a release');
  draw(14, 480);
  assert.equal(connection.nonce, 14);
  draw(15, 60_000);
  state(16);
  assert.equal(connection.nonce, 16, 'a picture from the future does not count');
  latest('/ws/drive').onclose();
  time.forward(250);
  draw(17, 490);
  assert.equal(connection.nonce, null, 'nonces of an earlier link do not count');
});

test('a new link requests no pictures for a screen that shows none', () => {
  latest('/ws/drive').open();
  latest('/ws/drive').onmessage({ data: '{"type":"state","frame":8}' });
  latest('/ws/drive').onclose();
  connection.showPictures(false);
  time.forward(250);
  latest('/ws/drive').open();
  for (let i = 0; i < 80; i += 1) {
    time.forward(100);
    latest('/ws/drive').onmessage({ data: '{"type":"pong"}' });
  }
  assert.equal(FakeSocket.all.filter(({ url, readyState }) => url.endsWith('/ws/video') && readyState < 2).length, 0);
});
