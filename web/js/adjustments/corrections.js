// Settings that correct a robot's wiring, its straight driving, and the orientation of its camera.

import { ask } from '../api.js';
import { group } from '../components/screen.js';
import { h, say } from '../dom.js';
import { fetchWords, percent, t } from '../i18n.js';

/** @typedef {{reverse: string, swap_sides: boolean, trim: number, turn_picture: number, mirror_picture: boolean, possible: string[]}} Corrections */
/** @typedef {(change: object) => Promise<any>} Correct  applies a correction; the robot stops first */

/** @param {import('../components/settings-screen.js').SettingsScreen} screen @returns {Promise<HTMLElement | null>} null if the robot supports no corrections */
export async function showCorrections(screen) {
  await fetchWords((code) => import(`./corrections/messages/${code}.js`));
  const now = /** @type {Corrections} */ (await ask('GET', 'api/corrections').catch(() => ({ possible: [] })));
  /** @type {Correct} */
  const correct = async (change) => {
    const done = await screen.put('api/corrections', change);
    if (!done) await screen.refresh();
    return done;
  };
  return now.possible.length ? h('div', { class: 'stack' }, picture(now, correct, screen), body(now, correct)) : null;
}

/** The camera's picture with buttons to turn it upright. @param {Corrections} now @param {Correct} correct @param {import('../components/settings-screen.js').SettingsScreen} screen */
function picture({ turn_picture: turn, mirror_picture: isMirrored, possible }, correct, screen) {
  if (!possible.includes('turn_picture')) return null;
  const seen = h('img', { class: 'seen', alt: t('settings.camera') });
  let looks = 0;
  /** Show the video stream while it is visible. The stream is started again after each turn, because a browser may keep the size of the first picture. */
  const look = () => seen.setAttribute('src', `video.mjpg?${(looks += 1)}`);
  const inView = new IntersectionObserver(([{ isIntersecting }]) => (isIntersecting ? look() : seen.removeAttribute('src')));
  inView.observe(seen);
  screen.endings?.push(() => {
    inView.disconnect();
    seen.removeAttribute('src'); // otherwise the browser would keep receiving the stream
  });
  let turned = turn;
  const turnOn = async () => {
    turned = (turned + 90) % 360;
    if (await correct({ turn_picture: turned }) && seen.hasAttribute('src')) look();
  };
  return group(t('settings.picture'), t('settings.turn_hint'), seen,
    h('button', { type: 'button', onclick: turnOn }, t('settings.turn')),
    tick('settings.mirrored', isMirrored, (checked) => correct({ mirror_picture: checked })));
}

/** @param {string} key @param {boolean} checked @param {(checked: boolean) => void} act */
function tick(key, checked, act) {
  const box = h('input', { type: 'checkbox', checked, onchange: () => act(box.checked) });
  return h('label', { class: 'choice' }, box, h('span', {}, t(key)));
}

/** @param {Corrections} now @param {Correct} correct */
function body({ reverse, swap_sides: isSwapped, trim, possible }, correct) {
  const can = (/** @type {string} */ name) => possible.includes(name);
  if (!['reverse', 'swap_sides', 'trim'].some(can)) return null;
  const told = (/** @type {number} */ value) => `${value ? t(value < 0 ? 'move.left' : 'move.right') : ''} ${percent(Math.abs(value))}`;
  const shown = h('output', {}, told(trim));
  const slider = h('input', {
    type: 'range', min: -30, max: 30, step: 1, value: Math.round(trim * 100), 'aria-label': t('settings.trim'),
    oninput: () => say(shown, told(Number(slider.value) / 100)),
    onchange: () => correct({ trim: Number(slider.value) / 100 }),
  });
  const reversed = h('select', { 'aria-label': t('settings.reverse'), onchange: () => correct({ reverse: reversed.value }) },
    ...Object.entries({ none: '–', left: t('move.left'), right: t('move.right'), both: `${t('move.left')} + ${t('move.right')}` })
      .map(([side, label]) => h('option', { value: side, selected: side === reverse }, label)));
  return group(t('settings.body'), t('settings.body_hint'),
    can('trim') ? h('label', {}, t('settings.trim'), h('div', { class: 'slider' }, slider, shown)) : null,
    can('swap_sides') ? tick('settings.swapped', isSwapped, (checked) => correct({ swap_sides: checked })) : null,
    can('reverse') ? h('label', {}, t('settings.reverse'), ' ', reversed) : null);
}
