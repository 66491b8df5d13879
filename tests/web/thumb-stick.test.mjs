import assert from 'node:assert/strict';
import { test } from 'node:test';

/** The part of an element that a stick needs: 100 by 100 pixels. */
class FakeElement extends EventTarget {
  classes = new Set();
  classList = { toggle: (name, isOn) => void (isOn ? this.classes.add(name) : this.classes.delete(name)) };
  setAttribute() {}
  append() {}
  setPointerCapture() {}
  getBoundingClientRect() { return { left: 0, top: 0, width: 100, height: 100 }; }
}
const make = () => new FakeElement();
Object.assign(globalThis, { document: { createElement: make, createElementNS: make }, addEventListener() {} });
const { makeStick } = await import('../../web/js/inputs/thumb-stick.js');
const { Helm } = await import('../../web/js/helm.js');
const { declare } = await import('../../web/js/moves.js');

const MOVES = ['forward', 'left', 'right'];

for (const [what, y] of [['rests on it', 50], ['pushes it', 5]]) {
  test(`a stick whose thumb ${what} when the link ends accepts the next thumb, although it gets no pointerup of the first`, () => {
    declare(MOVES.map((name, i) => ({ name, label: {}, icon: '', does: '', steering: [0, -1, 1][i], throttle: 0.5 })));
    const helm = new Helm({ send: () => true, nextSeq: () => 1 }, () => ({ frame: 1 }));
    const follow = () => helm.follow({ mode: 'train', you_are_pilot: true }, MOVES);
    const stick = makeStick({ helm, preferences: { vibrate: false } }, 'left');
    const touch = (pointerId, clientY) => stick.dispatchEvent(Object.assign(new Event('pointerdown'), { pointerId, pointerType: 'touch', buttons: 1, clientX: 50, clientY }));
    follow();
    touch(1, y);
    assert.ok(stick.classes.has('held'));
    helm.lose(); // the page then builds its pad again, so the stick loses the thumb
    assert.ok(!stick.classes.has('held'));
    follow();
    touch(2, 5);
    assert.equal(helm.held, 'forward');
  });
}
