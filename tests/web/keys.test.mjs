import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Helm } from '../../web/js/helm.js';
import { stopOf } from '../../web/js/inputs/key-name.js';
import { moveOfKey } from '../../web/js/inputs/keys.js';
import { listenToKeyboard } from '../../web/js/inputs/keyboard.js';
import { listenForStop } from '../../web/js/inputs/stop-keys.js';
import { declare } from '../../web/js/moves.js';
import { FOCUSES, MOVES, historyOf } from './keyboards.mjs';

/** Number of generated histories. */
const KEYS = Number(process.env.DRIVELESSON_KEYS ?? (process.env.DRIVELESSON_FULL ? 5000 : 300));

class Place {
  constructor(tag, type = '') {
    Object.assign(this, { tag, type, isContentEditable: false, clicks: 0 });
  }

  /** Matches the selectors of inputs/; an element here is only its tag. */
  matches(selector) {
    return selector.split(/,\s*/).some((part) => part.split(':')[0] === this.tag);
  }

  click() {
    this.clicks += 1;
  }
}

/** A window that gets each event in the capturing phase, and again in the bubbling phase. */
function makeWindow() {
  const listeners = [];
  const body = new Place('body');
  Object.assign(globalThis, {
    HTMLElement: Place, document: { body },
    addEventListener: (type, act, isEarly = false) => listeners.push({ type, act, isEarly }),
  });
  return {
    body,
    fire(type, about = {}) {
      let isOver = false;
      const event = { type, target: body, defaultPrevented: false, preventDefault: () => (event.defaultPrevented = true), stopPropagation: () => (isOver = true), ...about };
      for (const isEarly of [true, false]) if (!isOver) for (const one of listeners) if (one.type === type && one.isEarly === isEarly) one.act(event);
      return event;
    },
  };
}

/** A page in Teach whose pilot has the wheel. */
function drivingPage({ moves = MOVES, hasStick = false, mode = 'train' } = {}) {
  const window = makeWindow();
  const helm = new Helm({ send: () => true, nextSeq: () => 1 }, () => ({ frame: 1 }));
  declare(MOVES.map((name, i) => ({ name, label: {}, icon: '', does: '', steering: [0, -1, 1, 0, -1, 1][i], throttle: [0.5, 0.5, 0.5, -0.5, 0, 0][i] })));
  Object.assign(helm, { hasStick });
  helm.follow({ mode, you_are_pilot: true }, moves);
  const page = { ...window, helm, stops: 0, mode, isDriving: true };
  page.follow = (now) => helm.follow({ mode: (page.mode = now), you_are_pilot: true }, moves);
  // The robot obeys at once, because only the page is tested.
  const isDriving = () => page.isDriving;
  listenForStop({ stop: () => { page.stops += 1; helm.releaseAll(); page.follow('stopped'); }, isDriving, mayMove: () => helm.mayBeMoving });
  listenToKeyboard(helm, { isDriving });
  globalThis.addEventListener('blur', () => helm.releaseAll());
  return page;
}

const INPUTS = [
  // The event, the kind of stop that it causes, and the move that it drives
  [{ code: 'KeyW', key: 'w' }, null, 'forward'], [{ code: 'KeyW', key: 'z' }, null, 'forward'], [{ code: 'KeyW', key: 'ц' }, null, 'forward'],
  [{ code: 'KeyW', key: 'Process', keyCode: 229 }, null, 'forward'], [{ code: 'KeyA', key: 'q' }, null, 'left'], [{ code: 'KeyZ', key: 'w' }, null, undefined],
  [{ code: '', key: 'w' }, null, 'forward'], [{ code: '', key: 'W' }, null, 'forward'], [{ key: 'd' }, null, 'right'], [{ code: '', key: '3' }, null, 'right'],
  [{ code: 'Digit2', key: 'é' }, null, 'left'], [{ code: 'Unidentified', key: 'ArrowLeft' }, null, 'left'], [{ code: '', key: 'Up' }, null, 'forward'],
  [{ code: '', key: 'ц', keyCode: 87 }, null, 'forward'], [{ code: '', key: 'é', keyCode: 50 }, null, 'left'],
  [{ code: '', key: 'Unidentified', keyCode: 40 }, null, 'backward'], [{ code: '', key: 'Unidentified', keyCode: 65 }, null, 'left'],
  [{ code: 'Numpad8', key: '8', location: 3 }, null, 'forward'], [{ code: 'Numpad8', key: 'ArrowUp', location: 3 }, null, 'forward'],
  [{ code: '', key: '4', location: 3 }, null, 'left'], [{ code: 'Numpad4', key: 'Unidentified' }, null, 'left'],
  [{ code: 'CapsLock', key: 'ArrowUp' }, null, 'forward'], [{ code: 'ArrowUp', key: 'ArrowDown' }, null, 'backward'], [{ code: 'ArrowUp', key: 'Unidentified' }, null, 'forward'],
  [{ code: 'Space', key: ' ' }, 'space'], [{ code: '', key: ' ' }, 'space'], [{ code: '', key: 'Spacebar' }, 'space'], [{ code: 'Space', key: 'Unidentified' }, 'space'],
  [{ code: 'Space', key: 'Process', keyCode: 229 }, 'space'], [{ code: 'Space', key: '\u00a0' }, 'space'], [{ key: '\u3000' }, 'space'], [{ code: '', key: '', keyCode: 32 }, 'space'],
  [{ code: 'KeyW', key: ' ' }, 'space', 'forward'], [{ code: 'Space', key: 'w' }, 'space', undefined],
  ...['MediaStop', 'MediaPause', 'MediaPlayPause', 'Pause', 'Escape', 'Esc', 'BrowserBack', 'GoBack'].map((key) => [{ code: '', key }, 'named']),
  ...[413, 19, 10009, 461, 10252, 178, 27].map((keyCode) => [{ code: '', key: 'Unidentified', keyCode }, 'named']),
  [{ code: '', key: 'Unidentified', keyCode: 0 }, 'unnamed'], [{ code: '', key: 'Unidentified', keyCode: 229 }, 'unnamed'], [{ code: '', key: 'Process', keyCode: 229 }, 'unnamed'], [{}, 'unnamed'],
  ...['Enter', 'Select', 'ChannelUp', 'Tab', 'Shift', 'Dead', 'AudioVolumeUp', 'F5', 'm', '0'].map((key) => [{ code: '', key }, null]),
];

for (const [event, stop, move] of INPUTS) {
  test(`a key with ${JSON.stringify(event)} ${stop ? `stops: ${stop}` : `drives: ${move}`}`, () => {
    assert.equal(stopOf(event), stop);
    assert.equal(moveOfKey(event, MOVES).move, move);
  });
}

test('no generated keyboard drives on after a stop was pressed or a key came up', (context) => {
  let nowMs = 1000;
  Object.defineProperty(globalThis, 'performance', { value: { now: () => nowMs }, configurable: true });
  const pass = (ms) => { nowMs += ms; context.mock.timers.tick(ms); };
  const counts = { drives: 0, stops: 0, silence: 0 };
  for (let seed = 1; seed <= KEYS; seed += 1) {
    const { keyboard, steps } = historyOf(seed);
    context.mock.timers.reset(); // Node 20 keeps running an interval that is cleared in its own callback
    context.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
    const hasStick = seed % 4 === 0; // with proportional steering a key steers gradually, so the first move is ahead
    const page = drivingPage({ hasStick });
    const mayHold = (step) => page.helm.held === null || (hasStick ? step.allowed.length > 0 : step.allowed.includes(page.helm.held));
    const places = { body: page.body, button: new Place('button'), select: new Place('select'), text: new Place('input', 'text'), range: new Place('input', 'range'), dialog: new Place('button') };
    assert.deepEqual(Object.keys(places), FOCUSES);
    let target = page.body;
    steps.forEach((step, i) => {
      const at = `history ${seed}, step ${i}, ${JSON.stringify(keyboard)}: ${JSON.stringify(steps.slice(Math.max(0, i - 6), i + 1))}`;
      const before = page.mode;
      if (step.type === 'focus') target = places[step.on];
      else if (step.type === 'unlink') page.helm.lose();
      else if (step.type === 'train' || step.type === 'autonomous') page.follow(step.type);
      else if (step.type === 'hidden') page.helm.releaseAll();
      else if (step.type === 'silence') pass(2600);
      else page.fire(step.type, step.init ? { ...step.init, target } : {});
      const { held } = page.helm;
      if (step.isStop) {
        assert.equal(page.mode, 'stopped', at);
        counts.stops += Number(before !== 'stopped');
      }
      if (page.mode === 'stopped') assert.equal(held, null, at);
      assert.ok(mayHold(step), `${held} drives on: ${at}`);
      if (step.drives && page.helm.mayMove && ['body', 'button'].includes(target.tag) && target !== places.select) {
        counts.drives += 1;
        hasStick ? assert.ok(held, at) : assert.equal(held, step.drives, at);
      }
      counts.silence += Number(step.type === 'silence');
      pass(step.init?.repeat ? 33 : 200);
      assert.ok(mayHold(step), `${page.helm.held} drives on after a while: ${at}`);
    });
  }
  for (const [what, count] of Object.entries(counts)) assert.ok(count > KEYS / 20, `${what}: ${count}`);
});

for (const [what, come] of Object.entries({
  'a menu of the browser': (fire) => fire('contextmenu'),
  'a drag': (fire) => fire('dragstart'),
  'the menu bar (Alt)': (fire) => fire('keydown', { key: 'Alt', altKey: true, code: 'AltLeft' }),
  'the menu bar (F10)': (fire) => fire('keydown', { key: 'F10', code: 'F10' }),
  'a shortcut of macOS (Meta)': (fire) => fire('keydown', { key: 'Meta', metaKey: true, code: 'MetaLeft' }),
  'a key whose press was not seen': (fire) => fire('keyup', { key: 'k', code: 'KeyK' }),
})) {
  for (const hasStick of [false, true]) {
    test(`a key whose release is lost to ${what} stops driving${hasStick ? ', nor proportionally' : ''}`, () => {
      const { fire, helm } = drivingPage({ hasStick });
      fire('keydown', { key: 'ArrowUp', code: 'ArrowUp' });
      assert.equal(helm.held, 'forward');
      come(fire);
      assert.equal(helm.held, null);
      fire('keydown', { key: 'ArrowUp', code: 'ArrowUp', repeat: true });
      assert.equal(helm.held, null, 'its repeats do not count');
      fire('keyup', { key: 'ArrowUp', code: 'ArrowUp' });
    });
  }
}

test('a menu releases no finger, and a long press that opens no menu releases nothing', () => {
  const { fire, helm } = drivingPage();
  helm.press('finger 1', 'forward');
  fire('contextmenu');
  assert.equal(helm.held, 'forward');
  helm.releaseAll();
  fire('keydown', { key: 'ArrowUp', code: 'ArrowUp' });
  fire('contextmenu', { defaultPrevented: true });
  assert.equal(helm.held, 'forward', 'the pad has prevented its own menu');
});

test('a keyboard that does not always repeat is trusted once it has reported a release', (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  let nowMs = 0;
  Object.defineProperty(globalThis, 'performance', { value: { now: () => nowMs }, configurable: true });
  const pass = (ms) => { nowMs += ms; context.mock.timers.tick(ms); };
  const { fire, helm } = drivingPage();
  const up = { key: 'ArrowUp', code: 'ArrowUp' };
  const hold = (ms) => (fire('keydown', up), pass(500), fire('keydown', { ...up, repeat: true }), pass(ms), helm.held);
  assert.equal(hold(900), 'forward');
  assert.equal(hold(1100), null, 'the key is silent for twice its longest pause');
  fire('keyup', up);
  assert.equal(hold(60_000), 'forward');
});

for (const hasStick of [false, true]) {
  test(`the older key of a chord is released some time after the newest key came up${hasStick ? ', with proportional steering, too' : ''}`, (context) => {
    context.mock.timers.enable({ apis: ['setTimeout', 'setInterval'] });
    let nowMs = 0;
    Object.defineProperty(globalThis, 'performance', { value: { now: () => nowMs }, configurable: true });
    const pass = (ms) => { nowMs += ms; context.mock.timers.tick(ms); };
    const { fire, helm } = drivingPage({ hasStick });
    const [up, left] = ['ArrowUp', 'ArrowLeft'].map((name) => ({ key: name, code: name }));
    const tapLeft = () => (fire('keydown', left), pass(300), fire('keyup', left));
    fire('keydown', up);
    pass(60_000);
    assert.ok(helm.held, 'a single key that does not repeat is trusted');
    for (let i = 0; i < 9; i += 1) {
      tapLeft();
      pass(4500);
      assert.equal(helm.held, 'forward', 'each tap proves that somebody is there');
    }
    pass(600);
    assert.equal(helm.held, null);
    fire('keydown', up);
    tapLeft();
    fire('keydown', { key: 'Shift', code: 'ShiftLeft' });
    fire('keyup', { key: 'Shift', code: 'ShiftLeft' });
    pass(5100);
    assert.equal(helm.held, null);
    fire('keyup', up);
    fire('keydown', up);
    tapLeft();
    pass(60_000);
    assert.equal(helm.held, 'forward', 'the key was really down the last time, so it is trusted now');
  });
}

for (const [how, down, up] of [
  ['Shift', { key: 'w' }, { key: 'W', shiftKey: true }],
  ['a change of the layout', { key: 'w' }, { key: 'ц' }],
  ['a change of the layout to the letter of another direction', { key: 'a' }, { key: 'q' }],
  ['AltGr', { key: 'q' }, { key: '@' }],
  ['an input method', { key: 'w' }, { key: 'Process', keyCode: 229 }],
  ['an input method that says nothing', { key: 'w' }, {}],
  ['a dead key', { key: 'e' }, { key: 'Dead' }],
  ['Num Lock', { key: '8', location: 3 }, { key: 'ArrowUp', location: 3 }],
  ['an input method that ended', { key: 'Process', keyCode: 229, code: 'KeyW' }, { key: 'w', keyCode: 87 }],
]) {
  for (const hasStick of [false, true]) {
    test(`a key without a code whose name was changed by ${how} is released${hasStick ? ', with proportional steering, too' : ''}`, () => {
      for (const others of [[], [{ key: 'd' }], [{ key: 'ArrowRight', code: 'ArrowRight' }]]) {
        const { fire, helm } = drivingPage({ hasStick });
        for (const key of [...others, down]) fire('keydown', key);
        assert.ok(helm.held);
        fire('keyup', up);
        for (const key of others) fire('keyup', key);
        assert.equal(helm.held, null, JSON.stringify(others));
      }
    });
  }
}

test('space stops a robot that may move once, whatever has the focus and whichever modifiers are down', () => {
  for (const mode of ['train', 'autonomous']) {
    for (const target of [new Place('button'), new Place('select'), new Place('input', 'text'), new Place('textarea'), new Place('input', 'range')]) {
      for (const [about, isLost] of [[{}, false], [{ ctrlKey: true }, false], [{ altKey: true }, false], [{ shiftKey: true }, false], [{ repeat: true }, false], [{}, true]]) {
        const page = drivingPage({ mode });
        if (isLost) page.helm.lose();
        const space = { key: ' ', code: 'Space', target };
        assert.ok(page.fire('keydown', { ...space, ...about }).defaultPrevented);
        assert.equal(page.stops, 1, `${mode} ${target.tag} ${JSON.stringify(about)}`);
        page.follow('train');
        page.fire('keydown', { ...space, repeat: true });
        assert.equal(page.stops, 1, 'the key is still held, although the stop was released');
        assert.ok(page.fire('keyup', space).defaultPrevented, 'the key presses no button');
        page.fire('keydown', space);
        assert.equal(page.stops, 2);
      }
    }
  }
});

test('space presses the focused button while the robot stands, and stops a robot that was just started', () => {
  const page = drivingPage({ mode: 'stopped' });
  const space = { key: ' ', code: 'Space', target: new Place('button') };
  assert.ok(!page.fire('keydown', space).defaultPrevented);
  assert.ok(!page.fire('keyup', space).defaultPrevented);
  page.helm.choose('train');
  assert.ok(page.fire('keydown', space).defaultPrevented);
  page.fire('keyup', space);
  assert.equal(page.stops, 1);
  page.fire('keydown', { ...space, target: page.body });
  assert.equal(page.stops, 2, 'without a focus, space always stops');
});

test('a text field on another screen gets the space, but not the stop keys that write nothing', () => {
  const page = drivingPage({ mode: 'autonomous' });
  page.isDriving = false;
  for (const target of [new Place('input', 'text'), new Place('textarea'), Object.assign(new Place('p'), { isContentEditable: true })]) {
    for (const key of [{ key: ' ', code: 'Space' }, { key: 'Unidentified', code: '', keyCode: 229 }, {}]) assert.ok(!page.fire('keydown', { ...key, target }).defaultPrevented);
    assert.equal(page.stops, 0);
    page.fire('keydown', { key: 'MediaStop', code: '', target });
    assert.equal(page.stops, 1);
    Object.assign(page, { stops: 0 });
    page.follow('autonomous');
  }
});

test('Escape closes an open menu, and otherwise stops the robot', () => {
  const stops = [];
  const { fire } = makeWindow();
  let isOpen = true;
  globalThis.addEventListener('keydown', (event) => event.key === 'Escape' && isOpen && (event.preventDefault(), (isOpen = false)));
  listenForStop({ stop: () => stops.push('stop'), mayMove: () => true });
  const press = (key, about = {}) => (fire('keydown', { key, ...about }), fire('keyup', { key, ...about }));
  press('Escape');
  assert.deepEqual([isOpen, stops], [false, []]);
  press('Escape');
  assert.deepEqual(stops, ['stop']);
});

test('the OK key of a remote control presses the focused button', () => {
  const { fire } = drivingPage({ mode: 'stopped' });
  const button = new Place('button');
  const press = (key, about = {}) => (fire('keydown', { key, ...about }), fire('keyup', { key, ...about }));
  for (const key of ['Select', 'OK', 'Accept']) press(key, { target: button });
  press('Enter', { target: button });
  assert.equal(button.clicks, 3, 'the browser itself handles Enter');
});
