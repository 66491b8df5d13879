import assert from 'node:assert/strict';
import { test } from 'node:test';

/** The part of a document that building a button needs. */
class FakeElement extends EventTarget {
  classes = new Set();
  classList = { add: (name) => this.classes.add(name), remove: (name) => this.classes.delete(name) };
  setAttribute() {}
  append() {}
}
globalThis.document = { createElement: () => new FakeElement() };
globalThis.HTMLElement = FakeElement;
const { h } = await import('../../web/js/dom.js');
const { Screen } = await import('../../web/js/components/screen.js');
const soon = () => new Promise((resolve) => setImmediate(resolve));

/** A button that sends a request; `answer` completes the last request. */
function asking(t, on) {
  const clock = { now: 1000 };
  t.mock.method(performance, 'now', () => clock.now);
  const asked = [];
  const control = h('button', { [on]: () => new Promise((answer) => asked.push(answer)) });
  const press = () => {
    const event = new Event(on.slice(2), { cancelable: true });
    control.dispatchEvent(event);
    return event;
  };
  return { clock, control, asked, press };
}

for (const on of ['onclick', 'onsubmit']) {
  test(`a second tap sends no request while the first is pending: ${on}`, async (t) => {
    const { clock, control, asked, press } = asking(t, on);
    press();
    clock.now += 400;
    assert.ok(press().defaultPrevented, 'the form does not leave the page');
    assert.equal(asked.length, 1);
    asked[0]();
    await soon();
    assert.ok(control.classes.has('fresh'), 'a finger that is already on its way must not tap again');
    press();
    assert.equal(asked.length, 2, 'a tap counts again after the person has seen the result');
    clock.now += 6000;
    press();
    assert.equal(asked.length, 3, 'a request that hangs does not block the button forever');
  });
}

test('a button without a request can be pressed any number of times, and each change of a value is sent', (t) => {
  t.mock.method(performance, 'now', () => 1000);
  let [pressed, changed] = [0, 0];
  const control = h('input', { onclick: () => void (pressed += 1), onchange: async () => { changed += 1; } });
  for (let i = 0; i < 3; i += 1) for (const name of ['click', 'change']) control.dispatchEvent(new Event(name));
  assert.deepEqual([pressed, changed], [3, 3]);
});

test('an open screen polls, but has only one request pending at a time', async (t) => {
  t.mock.timers.enable({ apis: ['setInterval'] });
  const screen = new Screen();
  screen.endings = [];
  const asked = [];
  screen.every(1000, () => new Promise((answer) => asked.push(answer)));
  t.mock.timers.tick(5000);
  assert.equal(asked.length, 1);
  asked[0]();
  await soon();
  t.mock.timers.tick(1000);
  assert.equal(asked.length, 2);
  screen.disconnectedCallback();
  asked[1]();
  await soon();
  t.mock.timers.tick(5000);
  assert.equal(asked.length, 2, 'a closed screen sends no request');
});
