// A screen never replaces newer data by older data, in whatever order the answers arrive.
import assert from 'node:assert/strict';
import { beforeEach, mock, test } from 'node:test';

/** The part of an element that these screens need. */
class FakeElement {
  isConnected = true;
  children = [];
  get firstChild() { return this.children[0] ?? null; }
  replaceChildren(...children) { this.children = children; }
  append(...children) { this.children.push(...children); }
  contains() { return false; }
  querySelector(what) { return this.children.includes(what) ? {} : null; }
}
Object.assign(globalThis, {
  HTMLElement: FakeElement, document: { activeElement: null, createElementNS: () => new FakeSign(), createElement: () => new FakeSign() },
  customElements: { define() {} }, isSecureContext: false,
});
class FakeSign extends FakeElement { setAttribute() {} addEventListener() {} }

const load = (name, folder = 'components') => import(`../../web/js/${folder}/${name}.js`);
const soon = () => new Promise(setImmediate);
/** @type {{path: string, words: any, fail: () => void, answer: (said: object) => void}[]} */
let asked;

beforeEach(() => {
  mock.timers.enable({ apis: ['setTimeout'] }); // so that no timeout waits for requests that stay unanswered
  asked = [];
  globalThis.fetch = (path, { body }) => new Promise((answer, fail) => asked.push({
    path, words: body && JSON.parse(body), fail, answer: (said) => answer({ ok: true, json: async () => said }),
  }));
});
test.afterEach(() => {
  mock.timers.reset();
  delete globalThis.fetch;
});

/** Ask twice; the newer question is answered first. */
async function twice(ask, said) {
  ask();
  ask();
  const half = asked.length / 2;
  for (const { path, answer } of asked.slice(half)) answer(said(path, 'new'));
  await soon();
  for (const { path, answer } of asked.slice(0, half)) answer(said(path, 'old'));
  await soon();
}

test('the gallery shows an edit, although an older answer arrives after it', async () => {
  const { GalleryScreen } = await load('gallery-screen', 'coaching');
  const gallery = Object.assign(new GalleryScreen(), { summary: {}, arrange() {}, renderDetail() {} });
  await twice(() => gallery.refresh(), (_, age) => ({ images: [age], moves: [], max_nodes: 9 }));
  assert.deepEqual(gallery.images, ['new']);
});

test('the home screen ignores a late answer about the models', async () => {
  const { HomeScreen } = await load('home-screen', 'library');
  const home = Object.assign(new HomeScreen(), { draw() {} });
  await twice(() => home.refresh(), (_, age) => ({ models: [age] }));
  assert.deepEqual(home.known, ['new']);
});

test('the settings screen ignores a late answer', async () => {
  const { SettingsScreen } = await load('settings-screen');
  let shown;
  const settings = Object.assign(new SettingsScreen(), { renderRobot: (one) => (shown = one) });
  await twice(() => settings.refresh(), (_, age) => age);
  assert.equal(shown, 'new');
});

test('the last chosen setting is sent last, although an earlier change is answered late or refused', async () => {
  const { SettingsScreen } = await load('settings-screen');
  const settings = Object.assign(new SettingsScreen(), { renderRobot() {}, page: { toast() {} } });
  for (const max_nodes of [4, 8, 16]) settings.begin({ max_nodes });
  const wishes = () => asked.filter(({ words }) => words);
  await soon();
  assert.deepEqual(wishes().map(({ words }) => words.max_nodes), [4]);
  wishes()[0].fail();
  await soon();
  assert.deepEqual(wishes().map(({ words }) => words.max_nodes), [4, 8]);
  wishes()[1].answer({});
  await soon();
  assert.deepEqual(wishes().map(({ words }) => words.max_nodes), [4, 8, 16]);
});

test('undo takes back the time that is shown, although a longer time was chosen and is not answered yet', async () => {
  const { UndoScreen } = await load('undo-screen', 'coaching');
  const screen = Object.assign(new UndoScreen(), { summary: {}, strip: new FakeElement(), button: new FakeElement(), page: { toast() {} } });
  const show = (seconds) => Object.assign(screen, { seconds }).refresh();
  const last = (lessons) => ({ lessons, taught: {}, strip: [] });
  show('5');
  asked[0].answer(last(45));
  await soon();
  show('30');
  screen.undo();
  assert.deepEqual(asked.at(-1).words, { seconds: 5 });
  asked[1].answer(last(200));
  await soon();
  screen.undo();
  assert.deepEqual(asked.at(-1).words, { seconds: 30 });
});

test('a dropped model stays dropped, although an answer about it arrives late', async () => {
  const { showTeaching } = await load('teach-again', 'recordings');
  const home = { again: new FakeElement(), isConnected: true };
  home.again.append('progress');
  showTeaching(home);
  home.again.replaceChildren(); // the request of *Drop* was answered
  asked[0].answer({ state: 'failed', error: 'too late' });
  await soon();
  assert.deepEqual(home.again.children, []);
});

test('a training run is followed to its end, although one answer about it is lost', async () => {
  const { showTeaching } = await load('teach-again', 'recordings');
  const home = { again: Object.assign(new FakeElement(), { querySelector: () => ({}) }), isConnected: true };
  home.again.append('progress');
  showTeaching(home);
  asked[0].answer({ state: 'running', share: 0.5 });
  await soon();
  mock.timers.tick(400);
  asked[1].fail(new Error('lost'));
  await soon();
  assert.deepEqual(home.again.children, ['progress']);
  mock.timers.tick(400);
  asked[2].answer({ state: 'idle' });
  await soon();
  assert.deepEqual(home.again.children, []);
});

test('the study that was chosen last is shown, although the answer about another study arrives after it', async () => {
  const { StudyScreen } = await load('study-screen', 'study');
  const screen = Object.assign(new StudyScreen(), { body: new FakeElement(), trial: () => [], creation: () => null, study: ({ title }) => [title] });
  const list = async (name) => {
    screen.chosen = name;
    screen.list();
    asked.at(-1).answer({ studies: ['first', 'other'] });
    await soon();
    return asked.at(-1);
  };
  const [other, first] = [await list('other'), await list('first')];
  for (const one of [first, other]) {
    one.answer({ title: `the ${one === first ? 'first' : 'other'} study` });
    await soon();
    assert.ok(screen.body.children.includes('the first study'));
  }
  assert.equal(screen.chosen, 'first');
});

test('a result is not shown if the screen shows something else when it arrives', async () => {
  const { StudyScreen } = await load('study-screen', 'study');
  const screen = Object.assign(new StudyScreen(), { body: new FakeElement() });
  const conditions = { flatMap: () => ['a result'] };
  for (const isLeft of [false, true]) {
    screen.showResult('walk', 'P01');
    const [place] = screen.body.children;
    if (isLeft) screen.body.replaceChildren('the list');
    asked.at(-1).answer({ conditions });
    await soon();
    assert.deepEqual(place.children, ['a result']);
    assert.equal(screen.body.children.includes(place), !isLeft);
    screen.body.replaceChildren();
  }
});
